% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.

feature(f1, boolean, 1, v0, o, holding(v0)).
feature(f2, boolean, 2, v0, o, conj(holding(v0),mug(v0))).
feature(f3, numeric, 4, v0, o, some(v1,w,conj(atpose(v0,v1),some(v2,t,conj(some(v3,o,conj(some(v4,w,some(v5,w,some(v6,g,some(v7,q2,reach(v3,v4,v5,v6,v7,v2))))),mug(v3))),neg(some(v8,o,reachcfree(v2,v8,v1)))))))).
