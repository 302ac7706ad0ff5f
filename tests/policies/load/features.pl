% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.

feature(f1, numeric, 2, v0, o, every(v1,o,implies(neg(stackable(v0,v1)),neg(holding(v1))))).
feature(f2, numeric, 2, v0, o, some(v1,o,conj(on(v0,v1),surface(v1)))).
feature(f3, numeric, 4, v0, w, conj(neg(some(v1,o,unsafe(v1,v0))),some(v2,o,conj(some(v3,o,pose(v3,v0,v2)),every(v4,o,implies(stackable(v4,v2),neg(holding(v4)))))))).
