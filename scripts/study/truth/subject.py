"""A scene at a size, and how far each phase's picture of it is from truth: rows of accuracy.json."""

from study.core import registry
from study.core.registry import Scene, Spec
from study.numbers.accuracy import Colours, Row, Surface
from study.pictures import gate, images, panels
from study.pictures.gallery import Gallery, Size
from study.truth import judging, truth, where

BASE = Spec("baseline", "baseline")
FLOAT = Spec("opt4", "opt4")  # where truth is marched, phases behind it may be as far as it is


class Subject:
    """A scene at a size, with truth's picture of it and baseline's errors: read and worked out once."""

    def __init__(self, gallery: Gallery, scene: Scene, plain: Scene, size: Size, beside: list[Spec]) -> None:
        self.gallery, self.scene, self.plain, self.size = gallery, scene, plain, size
        self.truth = truth.picture(scene, size)
        self.mirrors = judging.mirrors(scene)
        planes = {name: self.truth[f"ideal.{name}"] for name in "RGB"}
        self.ideal = self.truth | planes | {"shadow": self.truth["shadow.ideal"]}
        self.base, made = self.measure(BASE)
        self.base_distances = judging.right_distances(self.truth, made)
        self.pictures = {"baseline": made, "the exact estimator": self.truth}
        self.references = {
            "baseline": self.base,
            "the exact estimator": judging.estimator(self.truth, scene.fractal),
        }
        for spec in beside:
            self.references[str(spec)], self.pictures[str(spec)] = self.measure(spec)

    def measure(self, spec: Spec) -> tuple[dict, images.Picture]:
        made, plain = (images.read(self.gallery.path(spec, s, self.size)) for s in (self.scene, self.plain))
        return judging.metrics(self.truth, made, plain, self.scene.fractal), made

    def row(self, spec: Spec) -> Row:
        found, made = self.measure(spec)
        phase = registry.find_phase(spec.phase)
        gated = gate.by_truth(phase)
        granted = gate.margins(phase) if gated else gate.visible(self.base)
        if gated:  # the planes hold depths as floats: 16 units away one rounding is over the 1e-6 of a grant
            granted["dt_p99"] = max(granted.get("dt_p99", 0), judging.rounding(self.truth, made))
        as_many = judging.dt_p99_of(self.base_distances, self.truth, made)
        outlines = int(granted.get(gate.OUTLINE, 0))

        def beyond(picture: images.Picture) -> dict[str, float]:
            return judging.beyond_outlines(self.truth, picture, outlines) if outlines else {}

        # What is not asked of the phase is not allowed it as an error of the references' either.
        others = {who: values | beyond(self.pictures[who]) for who, values in self.references.items()}
        ideal = gate.margins(phase, gate.IDEAL)
        worse = gate.inferior(found | beyond(made) | {"dt_p99": as_many}, others, granted, ideal)
        exact = self.ideal if ideal else self.truth
        places, wrong = where.classes(exact, self.mirrors), where.bad(exact, made)
        off = judging.metrics(exact, made) if ideal else {}
        found |= {name: off[name] for name in off if name.startswith(("flip", "fraction", "max_abs"))}
        gallery, size = self.gallery, self.size
        stem = f"{gallery.stem(spec, self.scene, size)}-against-truth.png"
        averaged, surface = found.pop("antialiased", None), found.pop("surface", None)
        row = Row(
            phase=str(spec),
            scene=self.scene.name,
            kind="fractal" if self.scene.fractal else "smooth",
            width=size[0],
            height=size[1],
            precision=phase.precision,
            **found,
            antialiased=averaged and Colours(**averaged),
            surface=surface and Surface(**surface | {"antialiased": Colours(**surface["antialiased"])}),
            dt_p99_of_as_many=as_many,
            beyond_outlines=beyond(made) or None,
            **where.shares(places, wrong),
            gated=gated,
            judged_by=gate.IDEAL if ideal else "estimator",
            to_ideal=bool(ideal),
            margins=granted,
            worse=list(worse),
            why=[f"{name}: {text}" for name, text in worse.items()],
            failed=bool(worse) if gated else "non_finite" in worse,
            binary_sha256=gallery.hashes[spec],
            truth_sha256=images.sha256(self.truth),
            picture=f"{gallery.folder.name}/{stem}",
        )
        title = f"{self.scene.name}, {size[0]}×{size[1]} pixels: {spec} against ground truth"
        figure = where.figure(exact, made, title, str(spec), row, places, wrong)
        panels.save(figure, gallery.folder / stem)
        return row
