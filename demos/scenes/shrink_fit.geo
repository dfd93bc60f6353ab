// A hollow shaft and a hub that is shrunk onto it, with facets of different lengths where they meet.
SetFactory("Built-in");
radius[] = {10, 20, 20, 40};
size[] = {1.5, 1.5, 2.0, 4.0};
Point(1) = {0, 0, 0};
For k In {0 : 3}
  // Four arcs around the middle each.
  p = 10 * (k + 1); r = radius[k]; h = size[k];
  Point(p) = {r, 0, 0, h}; Point(p + 1) = {0, r, 0, h}; Point(p + 2) = {-r, 0, 0, h}; Point(p + 3) = {0, -r, 0, h};
  Circle(p) = {p, 1, p + 1}; Circle(p + 1) = {p + 1, 1, p + 2};
  Circle(p + 2) = {p + 2, 1, p + 3}; Circle(p + 3) = {p + 3, 1, p};
  Curve Loop(p) = {p, p + 1, p + 2, p + 3};
EndFor
Plane Surface(1) = {20, 10};
Plane Surface(2) = {40, 30};
Physical Curve("bore") = {10, 11, 12, 13};
Physical Curve("seat") = {20, 21, 22, 23};
Physical Curve("hole") = {30, 31, 32, 33};
Physical Curve("rim") = {40, 41, 42, 43};
Physical Surface("shaft") = {1};
Physical Surface("hub") = {2};
