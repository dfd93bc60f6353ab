// The right half of two plates and a bolt with head and nut.
SetFactory("Built-in");
shank = 5; head = 9; hole = 5.5; long = 60; thick = 10; high = 6;
fine = 0.5; coarse = 3;
// The bolt, anticlockwise from the axis below.
Point(1) = {0, -thick - high, 0, coarse};
Point(2) = {head, -thick - high, 0, 1.5};
Point(3) = {head, -thick, 0, fine};
Point(4) = {shank, -thick, 0, fine};
Point(5) = {shank, thick, 0, fine};
Point(6) = {head, thick, 0, fine};
Point(7) = {head, thick + high, 0, 1.5};
Point(8) = {0, thick + high, 0, coarse};
For k In {1 : 8}
  Line(k) = {k, k == 8 ? 1 : k + 1};
EndFor
Curve Loop(1) = {1 : 8};
Plane Surface(1) = {1};
// The plates; what head and nut press on is a side of its own.
For k In {0 : 1}
  p = 20 * (k + 1); y = (k - 1) * thick;
  Point(p + 1) = {hole, y, 0, 0.6}; Point(p + 2) = {14, y, 0, 0.6}; Point(p + 3) = {long, y, 0, coarse};
  Point(p + 4) = {long, y + thick, 0, coarse}; Point(p + 5) = {14, y + thick, 0, 0.6};
  Point(p + 6) = {hole, y + thick, 0, 0.6};
  For j In {1 : 6}
    Line(p + j) = {p + j, j == 6 ? p + 1 : p + j + 1};
  EndFor
  Curve Loop(p) = {p + 1 : p + 6};
  Plane Surface(p) = {p};
EndFor
Physical Curve("axis") = {8};
Physical Curve("nut") = {3};
Physical Curve("head") = {5};
Physical Curve("under") = {21};
Physical Curve("joint below") = {24, 25};
Physical Curve("end below") = {23};
Physical Curve("joint above") = {41, 42};
Physical Curve("end above") = {43};
Physical Curve("over") = {45};
Physical Surface("bolt") = {1};
Physical Surface("plates") = {20, 40};
