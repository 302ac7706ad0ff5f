(define (stream belt)

  (:stream test-fits
    :inputs (?p ?b) :domain (and (Parcel ?p) (Bin ?b))
    :certified (Fits ?p ?b)))
