// A base of 300 x 100 x 60 on three feet of 60 x 100; its boundaries have names that fill the tables of a report.
Point(1) = {0, 0, 0};     Point(2) = {60, 0, 0};    Point(3) = {60, 0, 20};    Point(4) = {120, 0, 20};
Point(5) = {120, 0, 0};   Point(6) = {180, 0, 0};   Point(7) = {180, 0, 20};   Point(8) = {240, 0, 20};
Point(9) = {240, 0, 0};   Point(10) = {300, 0, 0};  Point(11) = {300, 0, 60};  Point(12) = {0, 0, 60};
For k In {1:12}
  Line(k) = {k, k % 12 + 1};
EndFor
Curve Loop(1) = {1:12};
Plane Surface(1) = {1};
out[] = Extrude {0, 100, 0} { Surface{1}; };
Physical Surface("left_foot_of_the_machine_frame_next_to_the_door") = {out[2]};
Physical Surface("middle_foot_of_the_machine_frame") = {out[6]};
Physical Surface("right_foot_of_the_machine_frame_next_to_the_window") = {out[10]};
Physical Surface("upper_face_with_the_press_and_the_motor") = {out[12]};
Physical Volume("body") = {out[1]};
Mesh.MeshSizeMax = 20;
