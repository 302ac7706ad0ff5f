(define (stream shelf)

  ; Where a box fits between the ends of the shelf: uniform, without end.
  (:stream sample-spot
    :inputs (?b) :domain (Box ?b)
    :outputs (?x) :certified (Spot ?b ?x))

  (:stream test-apart
    :inputs (?b ?x ?c ?y) :domain (and (Spot ?b ?x) (Spot ?c ?y))
    :certified (Apart ?b ?x ?c ?y)))
