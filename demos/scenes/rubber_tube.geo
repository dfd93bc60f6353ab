// The section of a tube of the radii 2 and 3: quarters of the inside are 1 to 4, of the outside 5 to 8.
Point(1) = {0, 0, 0};
For k In {0 : 3}
  Point(2 + k) = {2 * Cos(k * Pi / 2), 2 * Sin(k * Pi / 2), 0};
  Point(6 + k) = {3 * Cos(k * Pi / 2), 3 * Sin(k * Pi / 2), 0};
EndFor
For k In {0 : 3}
  Circle(1 + k) = {2 + k, 1, 2 + (k + 1) % 4};
  Circle(5 + k) = {6 + k, 1, 6 + (k + 1) % 4};
  Line(9 + k) = {2 + k, 6 + k};
EndFor
For k In {0 : 3}
  Curve Loop(1 + k) = {9 + k, 5 + k, -(9 + (k + 1) % 4), -(1 + k)};
  Plane Surface(1 + k) = {1 + k};
EndFor
Transfinite Curve {1 : 8} = 17;
Transfinite Curve {9 : 12} = 4;
Transfinite Surface {1 : 4};
Recombine Surface {1 : 4};
Physical Curve("inside") = {1 : 4};
Physical Curve("above") = {5, 6};
Physical Curve("below") = {7, 8};
Physical Surface("rubber") = {1 : 4};
