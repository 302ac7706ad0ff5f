:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/concepts').
:- use_module('../../logic/facts').
:- use_module('../../logic/engine').
:- use_module('../../logic/rules').

open_with(Text) :-
    text_file(Text, File),
    load_grammars([File], []),
    cup_file(Cup),
    read_facts(Cup),
    engine_setup,
    open_concepts.

:- begin_tests(concepts, [setup(open_with("concept(\"Held(x)\", \"Holding(x)\", 1).\n\c
                                           concept(\"Above(x,y)\", \"On(x,y) & ~Held(x)\", 2)."))]).

test(a_concept_may_use_those_before_it, F == conj(on(v0, v1), neg(holding(v0)))) :-
    concept('Above', [v0,v1], [object,object], F).

test(any_case_of_letters, [forall(member(Text, [held, 'HELD', 'Held'])),
                           true(Found = concept('Held', _, [object], _))]) :-
    vocabulary(Text, 1, Found).

test(predicates_as_shown_or_named, [forall(member(Text, ['On', on, 'ON'])),
                                    true(Found == predicate(on, [object,object]))]) :-
    vocabulary(Text, 2, Found).

test(arity_matters, fail) :-
    vocabulary(held, 2, _).

test(views_in_every_order, Positions == [[1,2],[2,1]]) :-
    findall(P, concept_view(concept('Above', P), role(object,object), 2, _), Positions).

test(a_view_denotes_its_formula, [true(Bits == 0b010), nondet]) :-
    concept_view(concept('Held', [1]), con(object), 1, Bits).

test(read, V-S-F == v0-object-some(v1, object, conj(on(v0, v1), neg(holding(v0))))) :-
    read_formula("∃y Above(x,y)", V, S, F).

test(read_closed, V-S-F == none-none-some(v0, object, holding(v0))) :-
    read_formula("∃x Held(x)", V, S, F).

test(a_wrong_concept_has_its_line, [cleanup(open_with("")), true(Line-Known == 2-true)]) :-
    catch(open_with("cap(role, 2).\nconcept(\"Odd(x)\", \"Blue(x)\", 1)."),
          error(grammar_error(_, Line, Message), _),
          true),
    ( sub_string(Message, _, _, _, "concept `Odd`: there is no predicate `Blue`") -> Known = true ; Known = Message ).

:- end_tests(concepts).
