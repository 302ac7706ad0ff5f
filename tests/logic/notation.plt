:- use_module(library(plunit)).
:- use_module('../../logic/notation').
:- use_module('../../logic/sorts').
:- use_module('../../logic/terms').
:- use_module(library(random)).

known('On', 2, predicate(on, [o,o])).
known('Red', 1, predicate(red, [o])).
known('At', 2, predicate(at, [o,w])).
known('Empty', 0, predicate(empty, [])).
known('Top', 1, concept('Top', [v0], [o], neg(some(v1, o, on(v1, v0))))).

read_text(Text, Sorts-Formula) :-
    parse_formula(Text, Free, Parsed),
    resolve(Parsed, [Free], known, Sorts, Formula).

complaint(Text, Column-Message) :-
    catch(( read_text(Text, _), fail ), error(notation_error(Column, Message), _), true).

:- begin_tests(notation).

test(ascii_and_symbols_are_one_language,
     [forall(member(Text, ["exists y: On(x,y) & ~Red(y)", "∃y On(x,y) ∧ ¬Red(y)", "some ?y. On(?x,?y) and not Red(?y)",
                           "∃y (On(x,y) /\\ !Red(y))", "#x: exists y On(x,y)&~Red(y)"])),
      F == [o]-some(v1, o, conj(on(v0, v1), neg(red(v1))))]) :-
    read_text(Text, F).

test(precedence, F == [o]-implies(disj(red(v0), conj(red(v0), neg(empty))), implies(empty, empty))) :-
    read_text("Red(x) | Red(x) & ~Empty => Empty => Empty", F).

test(a_quantifier_reaches_as_far_as_it_can, F == []-conj(empty, every(v0, o, implies(red(v0), empty)))) :-
    read_text("Empty & forall x: Red(x) => Empty", F).

test(wildcards_are_different_variables, F == []-some(v0, o, some(v1, w, at(v0, v1)))) :-
    read_text("At(_,_)", F).

test(a_wildcard_is_bound_at_its_atom, F == [w]-neg(some(v1, o, at(v1, v0)))) :-
    read_text("~At(_,p)", F).

test(concepts_are_expanded_with_fresh_variables,
     F == [o]-conj(neg(some(v1, o, on(v1, v0))), some(v2, o, conj(on(v0, v2), neg(some(v3, o, on(v3, v2))))))) :-
    read_text("Top(x) & exists y: On(x,y) & Top(y)", F).

test(inner_variables_hide_outer_ones, F == []-some(v0, o, conj(red(v0), some(v1, w, some(v2, o, at(v2, v1)))))) :-
    read_text("exists x: Red(x) & exists x: At(_,x)", F).

test(closure, F == [o]-some(v1, o, closure(v2, v3, o, on(v2, v3), v0, v1))) :-
    read_text("∃y {u,w | On(u,w)}⁺(x,y)", F).

test(complaints, [forall(member(Text-Column, ["On(x,"-6, "On(x,y"-7, "On(x) & )"-9, "Red(x) Red(y)"-8, "@"-1, "exists : Red(x)"-8])),
                  C == Column]) :-
    complaint(Text, C-_).

test(meaning, [forall(member(Text-Part, ["Blue(x)"-"no predicate", "On(x,y) & Red(x)"-"at most one variable",
                                         "∃z On(z,z) & At(z,z)"-"cannot be that argument",
                                         "exists y: Red(x)"-"what variable", "{u,w | On(u,w)}+(_,x)"-"ends of a closure"])),
               true(sub_string(M, _, _, _, Part)), nondet]) :-
    complaint(Text, _-M).

test(concept_heads, [forall(member(Head, ["Top(x,x)", "Top(_)", "~Top(x)", "Top(x,y,z)", "Top(x) & Top(y)"])),
                     throws(error(notation_error(_, _), _))]) :-
    parse_concept(Head-"Red(x)", _, _, _).

spelling(Name, Shown) :- memberchk(Name-Shown0, [on-'On', movable-'Movable']), !, Shown = Shown0.
spelling(Name, Name).

test(printed, [forall(member(F-Text,
         [ some(v1, o, conj(on(v0, v1), movable(v1)))-'∃y On(x,y) ∧ Movable(y)',
           conj(some(v1, o, on(v0, v1)), movable(v0))-'(∃y On(x,y)) ∧ Movable(x)',
           conj(neg(some(v1, o, on(v1, v0))), movable(v0))-'(¬∃y On(y,x)) ∧ Movable(x)',
           neg(conj(movable(v0), handempty))-'¬(Movable(x) ∧ handempty)',
           every(v1, o, implies(on(v1, v0), neg(movable(v1))))-'∀y On(y,x) ⇒ ¬Movable(y)',
           implies(implies(a, b), conj(disj(a, b), c))-'(a ⇒ b) ⇒ (a ∨ b) ∧ c',
           implies(a, implies(b, c))-'a ⇒ b ⇒ c',
           conj(a, conj(b, true))-'a ∧ b ∧ ⊤',
           some(v1, o, some(v2, pose, on(v1, v2)))-'∃y,z On(y,z)',
           some(v1, o, every(v2, o, on(v1, v2)))-'∃y ∀z On(y,z)',
           closure(v1, v2, o, on(v1, v2), v3, v0)-'{y,z | On(y,z)}⁺(w,x)',
           on(v25, v26)-'On(o,v26)' ])),
               Printed == Text]) :-
    describe_formula(F, spelling, Printed).

% Random formulas over known/3: what is printed is read back, up to the grouping of conj and disj.

test(printed_is_read_back, [forall(between(1, 500, Seed)), true(Again == Flat), nondet]) :-
    set_random(seed(Seed)),
    random_formula(5, [v0-o], F0),
    rename(F0, [v0-v0], F1, 1, _),
    flat(F1, Flat),
    describe_formula(F1, shown, Text),
    format(string(Given), "#x: (~w) ∧ Red(x)", [Text]),
    read_text(Given, [o]-conj(F, red(v0))),
    flat(F, Again).

shown(Name, Shown) :- known(Shown, _, predicate(Name, _)).

random_formula(0, Scope, F) :- !, random_atom(Scope, F).
random_formula(Depth, Scope, F) :-
    D is Depth - 1,
    random_member(Kind, [atom, neg, conj, conj, disj, implies, some, some, every, every, closure]),
    random_formula(Kind, D, Scope, F).

random_formula(atom, _, Scope, F) :- random_atom(Scope, F).
random_formula(neg, D, Scope, neg(F)) :- random_formula(D, Scope, F).
random_formula(Pair, D, Scope, F) :-
    memberchk(Pair, [conj, disj, implies]),
    random_formula(D, Scope, A),
    random_formula(D, Scope, B),
    F =.. [Pair,A,B].
random_formula(Quantifier, D, Scope, F) :-
    memberchk(Quantifier, [some, every]),
    length(Scope, N),
    atom_concat(b, N, V),
    random_formula(D, [V-o|Scope], A),
    F =.. [Quantifier,V,o,conj(red(V), A)].
random_formula(closure, _, Scope, closure(p, q, o, on(p, q), Y, X)) :-
    random_member(Y-o, Scope),
    random_member(X-o, Scope).

random_atom(Scope, F) :-
    random_member(Kind, [red, on, empty, true]),
    random_member(A-_, Scope),
    random_member(B-_, Scope),
    atom_of(Kind, A, B, F).

atom_of(red, A, _, red(A)).
atom_of(on, A, B, on(A, B)).
atom_of(empty, _, _, empty).
atom_of(true, _, _, true).

% flat(+Formula, -Flat): nested conjunctions and disjunctions are lists.

flat(F0, F) :-
    functor(F0, Name, 2),
    memberchk(Name, [conj, disj]),
    !,
    phrase(parts(Name, F0), Parts),
    F =.. [Name,Parts].
flat(F0, F) :-
    F0 =.. [Name|Parts0],
    maplist(flat, Parts0, Parts),
    F =.. [Name|Parts].

parts(Name, F) --> { F =.. [Name,A,B] }, !, parts(Name, A), parts(Name, B).
parts(_, F0) --> { flat(F0, F) }, [F].

:- end_tests(notation).
