:- use_module(library(plunit)).
:- use_module('../../logic/notation').
:- use_module('../../logic/facts').
:- use_module('../../logic/engine').
:- use_module('../../logic/evaluate').

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

hidden(at(_, _), [1]).

test(cost, [forall(member(Text-Cost, ["Red(x)"-1, "Empty"-1, "∃y On(x,y)"-2, "∃o At(o,p)"-1, "At(_,p)"-1,
                                      "∃o At(o,p) ∧ Red(o)"-2, "∃x Red(x)"-2, "∃y On(x,y) ∧ Red(y) ∧ Red(x)"-3,
                                      "∃y ∀z On(x,y) ⇒ On(z,y)"-3, "Red(x) ⇒ Empty"-3, "∃y On(x,y) ⇒ Red(y)"-3])),
            true(C == Cost), nondet]) :-
    parse_formula(Text, Free, Parsed),
    resolve(Parsed, [Free], known, Sorts, Formula),
    ( Sorts = [_|_] -> V = v0 ; V = none ),
    formula_cost(formula(V, Formula), hidden, C).

:- end_tests(notation).
