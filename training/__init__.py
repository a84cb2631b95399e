"""How the embedded vision model is made: pictures of random streets, labels, two networks, their files and figures.

`make train` renders, trains, calibrates, exports and draws; whatever was interrupted goes on
where it stopped. Needs the extra `train` (PyTorch); nothing that runs in a delivery imports this package.

    looks, streets, stops   what is drawn, by seed
    labels, render, shards  pictures and what is really in them
    nets, fit_*             the proposer and the namer
    judge, calibrate        what the trained pair sees on validation pictures
    export, plots           the files the gateway reads, and the figures of the model card
"""
