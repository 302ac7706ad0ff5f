% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.

feature(f1, boolean, 1, v0, o, holding(v0)).
feature(f2, numeric, 2, v0, o, some(v1,o,conj(on(v0,v1),block(v1)))).
