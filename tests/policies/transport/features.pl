% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.

feature(f1, boolean, 1, v0, o, holding(v0)).
feature(f2, boolean, 2, v0, o, conj(holding(v0),neg(tray(v0)))).
feature(f3, numeric, 2, v0, o, some(v1,o,conj(on(v0,v1),movable(v1)))).
feature(f4, numeric, 2, v0, o, some(v1,o,conj(on(v0,v1),neg(stackable(v0,v1))))).
feature(f5, boolean, 3, v0, q2, conj(atbase(v0),some(v1,o,conj(beside(v0,v1),green(v1))))).
feature(f6, numeric, 3, v0, w, conj(neg(some(v1,o,unsafe(v1,v0))),some(v2,o,conj(some(v3,o,pose(v3,v0,v2)),movable(v2))))).
