% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.

feature(f1, boolean, 1, v0, o, holding(v0)).
feature(f2, numeric, 2, v0, o, some(v1,o,conj(on(v0,v1),table(v1)))).
feature(f3, numeric, 3, v0, o, conj(green(v0),some(v1,o,conj(on(v1,v0),red(v1))))).
feature(f4, numeric, 3, v0, o, conj(red(v0),some(v1,o,conj(on(v1,v0),green(v1))))).
