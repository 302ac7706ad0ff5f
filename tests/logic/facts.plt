:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/facts').

open_data :- cup_file(File), read_facts(File).

refused(Text, Formal) :-
    text_file(Text, File),
    catch(( read_facts(File), fail ), error(Formal, _), true).

:- begin_tests(facts, [setup(open_data)]).

test(states_are_numbered, N-Mask == 3-0b111) :-
    state_count(N),
    problem_states(0, Mask).

test(slots_count_within_a_sort, Slots == [cup-0, t1-1, t2-2, p1-0, p2-1, p3-2]) :-
    findall(E-I, ( member(E, [cup,t1,t2,p1,p2,p3]), slot(E, 0, _, I) ), Slots).

test(a_fluent_holds_in_its_states, Rows == [[cup,t1]-0b001, [cup,t2]-0b100]) :-
    findall(A-S, tuple(on, 0, S, A), Rows).

test(a_static_fact_holds_everywhere, Rows == [[cup,t1]-0b111, [cup,t2]-0b111]) :-
    findall(A-S, tuple(near, 0, S, A), Rows).

test(what_is_a_fluent, Fluents == [atpose, holding, on]) :-
    findall(P, ( predicate(P, _), fluent(P) ), Fluents0),
    sort(Fluents0, Fluents).

test(spelling, Shown == ["On", near]) :-
    maplist(spelling, [on,near], Shown).

test(refused, [forall(member(Text-Formal,
         [ "shell(ls)."-domain_error(training_fact, shell(ls)),
           ":- initialization(halt)."-domain_error(training_fact, (:- initialization(halt))),
           "state(X, 0)."-domain_error(training_fact, _),
           "fluent(0, on(a))."-existence_error(predicate, on/1),
           "problem(0). state(7, 0)."-domain_error(state_number, 7),
           "problem(0). state(0, 0). transition(0, 0, 1)."-existence_error(state, 1),
           "problem(0). entity(0, o, a)."-existence_error(sort, o),
           "sort(o). predicate(p, [o]). at_most_one(p). problem(0). entity(0, o, a). entity(0, o, b). state(0, 0).
            fluent(0, p(a)). fluent(0, p(b))."-domain_error(at_most_one(p), _) ])),
                cleanup(open_data),
                true(subsumes_term(Formal, Thrown))]) :-
    refused(Text, Thrown).

:- end_tests(facts).
