:- use_module(library(plunit)).
:- use_module('../../logic/sorts').

known('On', 2, predicate(on, [o,o])).
known('At', 2, predicate(at, [o,w])).
known('Top', 1, concept('Top', [v0], [o], neg(some(v1, o, on(v1, v0))))).

complaint(Parsed, Names, Message) :-
    catch(( resolve(Parsed, Names, known, _, _), fail ), error(notation_error(_, Message), _), true).

:- begin_tests(sorts).

test(free_variables_come_first, Sorts-F == [w,o]-some(v2, o, conj(at(v2, v0), on(v2, v1)))) :-
    resolve(some(z, conj(atom('At', [z,p], 1), atom('On', [z,x], 1))), [p,x], known, Sorts, F).

test(unnamed_ones_are_bound_at_their_atom, F == neg(some(v0, o, some(v1, w, at(v0, v1))))) :-
    resolve(neg(atom('At', ['_','_'], 1)), [auto], known, [], F).

test(concepts_are_written_out, F == every(v0, o, neg(some(v1, o, on(v1, v0))))) :-
    resolve(every(x, atom('Top', [x], 1)), [auto], known, [], F).

test(complaints, [forall(member(Parsed-Names-Part,
         [ atom('Blue', [x], 1)-[auto]-"no predicate",
           atom('On', [x], 1)-[auto]-"with 1 argument",
           atom('On', [x,y], 1)-[auto]-"at most one variable",
           atom('On', [x,y], 1)-[x]-"`y` is not bound",
           conj(atom('On', [x,x], 1), atom('At', ['_',x], 1))-[x]-"cannot be that argument",
           true-[x]-"what variable `x`",
           closure(u, w, atom('On', [u,w], 1), '_', x)-[x]-"ends of a closure",
           conj(atom('At', [x,p], 1), closure(u, w, atom('On', [u,w], 1), x, p))-[x,p]-"of another sort" ])),
                   true(sub_string(Message, _, _, _, Part)), nondet]) :-
    complaint(Parsed, Names, Message).

:- end_tests(sorts).
