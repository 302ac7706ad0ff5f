; Boxes come on a belt and are to stand on a shelf, side by side.
(define (domain shelf)
  (:requirements :strips :negative-preconditions :existential-preconditions :derived-predicates)

  (:predicates
    (Box ?b)
    (Spot ?b ?x)              ; certified: box ?b fits on the shelf at ?x
    (Apart ?b ?x ?c ?y)       ; tested: ?b at ?x does not touch ?c at ?y
    (Waiting ?b) (Holding ?b) (HandEmpty) (AtSpot ?b ?x)
    (Stands ?b) (Taken ?b ?x))

  (:action put
    :parameters (?b ?x)
    :precondition (and (Holding ?b) (Spot ?b ?x) (not (Taken ?b ?x)))
    :effect (and (AtSpot ?b ?x) (HandEmpty) (not (Holding ?b))))

  (:action take
    :parameters (?b)
    :precondition (and (Waiting ?b) (HandEmpty))
    :effect (and (Holding ?b) (not (Waiting ?b)) (not (HandEmpty))))

  (:derived (Stands ?b) (exists (?x) (and (Spot ?b ?x) (AtSpot ?b ?x))))
  (:derived (Taken ?b ?x)
    (exists (?c ?y) (and (Spot ?b ?x) (Spot ?c ?y) (AtSpot ?c ?y) (not (Apart ?b ?x ?c ?y))))))
