// The upper half of the section of an O-ring: its radius is 1, that of the ring 5.
h = 0.08;
Point(1) = {5, 0, 0, h};
For k In {0 : 4}
  Point(2 + k) = {5 + Cos(k * Pi / 4), Sin(k * Pi / 4), 0, h};
EndFor
For k In {1 : 4}
  Circle(k) = {1 + k, 1, 2 + k};
EndFor
Line(5) = {6, 1};
Line(6) = {1, 2};
Curve Loop(1) = {1 : 6};
Plane Surface(1) = {1};
Recombine Surface {1};
Physical Curve("middle") = {5, 6};
Physical Curve("outside") = {1};
Physical Curve("above") = {2, 3};
Physical Surface("rubber") = {1};
