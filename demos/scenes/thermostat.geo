// A strip of two layers, 40 long and 0.5 thick each; its lower side is divided where the stop may touch it.
SetFactory("Built-in");
Point(1) = {0, -0.5, 0};  Point(2) = {30, -0.5, 0};  Point(3) = {40, -0.5, 0};
Point(4) = {40, 0, 0};    Point(5) = {40, 0.5, 0};   Point(6) = {0, 0.5, 0};   Point(7) = {0, 0, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};
Line(5) = {5, 6};  Line(6) = {6, 7};  Line(7) = {7, 1};  Line(8) = {4, 7};
Curve Loop(1) = {1, 2, 3, 8, 7};  Plane Surface(1) = {1};
Curve Loop(2) = {4, 5, 6, -8};    Plane Surface(2) = {2};
Physical Surface("invar") = {1};  Physical Surface("brass") = {2};
Physical Curve("clamp") = {6, 7};  Physical Curve("tip") = {2};
Mesh.MeshSizeMax = 0.35;
