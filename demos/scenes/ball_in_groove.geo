// A quarter of half a ball and of a block with a round groove along x[1]: they touch at the origin, on faces of their own.
SetFactory("OpenCASCADE");
ball = 5; groove = 5.5; side = 6; deep = 6; across = 1.2; along = 0.4; high = 0.5;
Sphere(1) = {0, 0, ball, ball};
Box(2) = {0, 0, 0, ball, ball, ball};
BooleanIntersection(3) = {Volume{1}; Delete;}{Volume{2}; Delete;};
Box(4) = {0, 0, -deep, side, side, deep + 1.5};
Cylinder(5) = {0, 0, groove, 0, side, 0, groove};
BooleanDifference(6) = {Volume{4}; Delete;}{Volume{5}; Delete;};
Box(7) = {0, 0, 0, across, along, high};
Box(8) = {0, 0, -high, across, along, 2 * high};
BooleanIntersection(9) = {Volume{3};}{Volume{7}; Delete;};
BooleanIntersection(10) = {Volume{6};}{Volume{8}; Delete;};
BooleanFragments{Volume{3}; Delete;}{Volume{9}; Delete;}
BooleanFragments{Volume{6}; Delete;}{Volume{10}; Delete;}
MeshSize{ : } = 1.2;
Physical Surface("ball") = {43};
Physical Surface("groove") = {32};
Physical Surface("top") = {37};
Physical Surface("left") = {30, 38, 44, 46};
Physical Surface("front") = {31, 41, 45, 47};
Physical Surface("bottom") = {50};
Physical Volume("steel") = {9 : 12};
