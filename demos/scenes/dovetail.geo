// The right half of a blade's foot and of the disc around its slot; the flanks lie on one line.
SetFactory("Built-in");
angle = 50 * Pi / 180; wide = 15; neck = 7; edge = 5; lip = 8.2; pitch = 30;
fine = 0.3; coarse = 3;
// The foot, anticlockwise; its fillet touches the flank and the stem.
top = edge + (wide - neck) * Tan(angle); r = 2;
at = top + r * (1 - Sin(angle)) / Cos(angle);
Point(1) = {0, 0, 0, coarse};
Point(2) = {wide - 1, 0, 0, 1};
Point(3) = {wide, 1, 0, 1};
Point(4) = {wide, edge, 0, fine};
Point(5) = {neck + r - r * Sin(angle), at - r * Cos(angle), 0, fine};
Point(6) = {neck, at, 0, fine};
Point(7) = {neck, 30, 0, coarse};
Point(8) = {0, 30, 0, coarse};
Point(9) = {neck + r, at, 0, 1};
For k In {1 : 4}
  Line(k) = {k, k + 1};
EndFor
Circle(5) = {5, 9, 6};
For k In {6 : 8}
  Line(k) = {k, k == 8 ? 1 : k + 1};
EndFor
Curve Loop(1) = {1 : 8};
Plane Surface(1) = {1};
// The disc: bore, side, rim, lip, flank, bottom of the slot, which the foot does not reach.
below = edge + (wide - lip) * Tan(angle); q = 1.5;
on = below + q * (1 - Sin(angle)) / Cos(angle);
Point(21) = {0, -25, 0, coarse};
Point(22) = {pitch, -25, 0, coarse};
Point(23) = {pitch, 20, 0, coarse};
Point(24) = {lip, 20, 0, 1};
Point(25) = {lip, on, 0, fine};
Point(26) = {lip + q - q * Sin(angle), on - q * Cos(angle), 0, fine};
Point(27) = {wide + 1, edge - Tan(angle), 0, fine};
Point(28) = {wide + 1, 1, 0, 1};
Point(29) = {wide - 1, -1, 0, 1};
Point(30) = {0, -1, 0, coarse};
Point(31) = {lip + q, on, 0, 1};
For k In {21 : 30}
  If (k == 25)
    Circle(k) = {25, 31, 26};
  Else
    Line(k) = {k, k == 30 ? 21 : k + 1};
  EndIf
EndFor
Curve Loop(2) = {21 : 30};
Plane Surface(2) = {2};
Physical Curve("stem") = {7};
Physical Curve("middle") = {8, 30};
Physical Curve("flank") = {4, 5};
Physical Curve("slot") = {25, 26};
Physical Curve("side") = {22};
Physical Curve("bore") = {21};
Physical Surface("blade") = {1};
Physical Surface("disc") = {2};
