// The dovetail foot of a blade, mm: its flanks are at 50 degrees to the horizontal, its edges and fillets are arcs.
angle = 50 * Pi / 180; half = 15; slim = 7; edge = 5; stem = 14; r = 2;
shoulder = edge + (half - slim) * Tan(angle);
t = r * Tan((Pi / 2 - angle) / 2); // the length that an arc takes from each of its sides
For side In {0 : 1}
  n = 20 * side; sign = 1 - 2 * side;
  Point(n + 1) = {sign * (half - r), 0, 0, 2};
  Point(n + 2) = {sign * half, r, 0, 2};
  Point(n + 3) = {sign * half, edge - t, 0, 2};
  Point(n + 4) = {sign * (half - t * Cos(angle)), edge + t * Sin(angle), 0, 2};
  Point(n + 5) = {sign * (slim + t * Cos(angle)), shoulder - t * Sin(angle), 0, 2};
  Point(n + 6) = {sign * slim, shoulder + t, 0, 2};
  Point(n + 7) = {sign * slim, shoulder + stem, 0, 2};
  Point(n + 8) = {sign * (half - r), r, 0, 2};
  Point(n + 9) = {sign * (half - r), edge - t, 0, 2};
  Point(n + 10) = {sign * (slim + r), shoulder + t, 0, 2};
  Circle(n + 1) = {n + 1, n + 8, n + 2};
  Line(n + 2) = {n + 2, n + 3};
  Circle(n + 3) = {n + 3, n + 9, n + 4};
  Line(n + 4) = {n + 4, n + 5};
  Circle(n + 5) = {n + 5, n + 10, n + 6};
  Line(n + 6) = {n + 6, n + 7};
EndFor
Line(41) = {21, 1};
Line(42) = {7, 27};
Curve Loop(1) = {41, 1 : 6, 42, -26 : -21};
Plane Surface(1) = {1};
Physical Curve("right") = {4};
Physical Curve("left") = {24};
Physical Curve("top") = {42};
Physical Surface("foot") = {1};
