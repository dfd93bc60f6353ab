// A rubber pad on a steel plate, meshed apart.
SetFactory("Built-in");
Point(1) = {-50, -10, 0, 5}; Point(2) = {50, -10, 0, 5}; Point(3) = {50, 0, 0, 3}; Point(4) = {-50, 0, 0, 3};
For k In {1 : 4}
  Line(k) = {k, k == 4 ? 1 : k + 1};
EndFor
Curve Loop(1) = {1 : 4};
Plane Surface(1) = {1};
Point(11) = {-30, 0, 0, 2}; Point(12) = {30, 0, 0, 2}; Point(13) = {25, 20, 0, 2}; Point(14) = {-25, 20, 0, 2};
For k In {11 : 14}
  Line(k) = {k, k == 14 ? 11 : k + 1};
EndFor
Curve Loop(2) = {11 : 14};
Plane Surface(2) = {2};
Physical Curve("bottom") = {1};
Physical Curve("plate") = {3};
Physical Curve("pad") = {11};
Physical Curve("top") = {13};
Physical Surface("steel") = {1};
Physical Surface("rubber") = {2};
