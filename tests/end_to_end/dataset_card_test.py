"""README.md and croissant.json of exports: the head that the Hugging Face Hub reads, and the words of MLCommons
Croissant 1.0 (docs.mlcommons.org/croissant/docs/croissant-spec.html), against the files that they are of."""

import collections
import fnmatch
import hashlib
import json
import re

import PIL.Image
import yaml

import exported_demo as demo
import program
from exported_demo import Export, of

setUpModule, tearDownModule = demo.set_up, demo.tear_down

FORMATS = ["yolo", "coco", "mpii", "davis", "webdataset", "events", "dsec", "rvt", "hpe", "raw", "aedat4"]
TASKS = {"yolo": {"object-detection", "keypoint-detection"}, "coco": {"object-detection", "keypoint-detection"},
         "mpii": {"keypoint-detection"}, "hpe": {"keypoint-detection"}, "davis": {"keypoint-detection"},
         "webdataset": {"object-detection", "keypoint-detection"}, "events": set()}

# A node's properties and their types: those that must be there, and those that may.
NODES = {
    "sc:Dataset": ({"@context": dict, "conformsTo": str, "name": str, "description": str, "keywords": list,
                    "distribution": list, "recordSet": list}, {"license": str}),
    "cr:FileObject": ({"@id": str, "name": str, "contentUrl": str, "contentSize": str, "encodingFormat": str,
                       "sha256": str}, {"description": str}),
    "cr:FileSet": ({"@id": str, "name": str, "encodingFormat": str, "includes": list}, {"description": str}),
    "cr:RecordSet": ({"@id": str, "name": str, "field": list},
                     {"description": str, "dataType": str, "key": dict, "data": list}),
    "cr:Field": ({"@id": str, "name": str, "dataType": str}, {"source": dict, "references": dict, "repeated": bool}),
}
SOURCE = ({"fileSet": dict, "extract": dict}, {"transform": dict, "format": str})
VALUES = {  # of each data type: whether a text, or what JSON has, is one
    "sc:Text": lambda value: isinstance(value, str), "sc:Integer": lambda value: int(value) == float(value),
    "sc:Float": lambda value: isinstance(float(value), float), "cr:BoundingBox": lambda value: len(value) == 4,
    "sc:ImageObject": lambda value: value.size[0] > 0}
# Terms of the context, which are short for those of these vocabularies.
PREFIXES = {"cr": "http://mlcommons.org/croissant/", "sc": "https://schema.org/", "dct": "http://purl.org/dc/terms/"}


class DatasetCards(Export):
    def check_properties(self, node, rules):
        required, optional = rules
        names = set(node) - {"@type"}
        self.assertEqual(set(required) - names, set(), node)
        self.assertEqual(names - set(required) - set(optional), set(), node)
        for name in names:
            self.assertIsInstance(node[name], {**required, **optional}[name], name)

    def check_node(self, node, kinds):
        self.assertIn(node["@type"], kinds)
        self.check_properties(node, NODES[node["@type"]])
        if "@id" in node:
            self.assertNotIn(node["@id"], self.ids)
            self.ids[node["@id"]] = node

    def check_croissant(self, out, splits):
        """The file against the vocabulary, and each field against the files that it is read from."""
        files = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
        files = {name for name in files if not name.startswith(".export/")}
        files -= {"README.md", "croissant.json", "export.json"}
        dataset = json.loads((out / "croissant.json").read_text())
        self.ids = {}
        self.check_node(dataset, {"sc:Dataset"})
        self.assertEqual(dataset["conformsTo"], "http://mlcommons.org/croissant/1.0")
        context = dataset["@context"]
        self.assertEqual({name: context[name] for name in PREFIXES}, PREFIXES)
        self.assertEqual(context["@vocab"], PREFIXES["sc"])
        for term in ("recordSet", "field", "fileSet", "extract", "fileProperty", "jsonPath", "regex", "references"):
            self.assertEqual(context[term], "cr:" + term)

        members, left = {}, collections.Counter(files)
        for resource in dataset["distribution"]:
            self.check_node(resource, {"cr:FileObject", "cr:FileSet"})
            self.assertRegex(resource["encodingFormat"], r"^[a-z]+/[a-z0-9.+-]+$")
            names = resource.get("includes", [resource.get("contentUrl")])
            # As a path's glob: * means no slash.
            members[resource["@id"]] = [name for name in files if any(
                name.count("/") == pattern.count("/") and fnmatch.fnmatchcase(name, pattern) for pattern in names)]
            self.assertGreater(len(members[resource["@id"]]), 0, resource)
            left.subtract(members[resource["@id"]])
            if resource["@type"] == "cr:FileObject":
                content = (out / resource["contentUrl"]).read_bytes()
                self.assertEqual((resource["contentSize"], resource["sha256"]),
                                 (f"{len(content)} B", hashlib.sha256(content).hexdigest()))
        self.assertEqual(set(left.values()), {0}, "each file is in one resource")

        self.assertEqual([record["splits/name"] for record in dataset["recordSet"][0]["data"]], splits)
        for records in dataset["recordSet"]:
            self.check_node(records, {"cr:RecordSet"})
            for field in records["field"]:
                self.check_node(field, {"cr:Field"})
                self.assertTrue(field["@id"].startswith(records["@id"] + "/"))
                if "data" not in records:
                    self.check_field(field, out, members[field["source"]["fileSet"]["@id"]], splits)
        for reference in self.references(dataset):
            self.assertIn(reference, self.ids)

    def references(self, node):
        """The ids of {"@id": ...} alone."""
        for value in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
            if isinstance(value, dict) and set(value) == {"@id"}:
                yield value["@id"]
            yield from self.references(value)

    def check_field(self, field, out, names, splits):
        source = field["source"]
        self.check_properties(source, SOURCE)
        (extract, what), = source["extract"].items()
        self.assertIn((extract, what if extract == "fileProperty" else None),
                      {("jsonPath", None), *(("fileProperty", name) for name in ("fullpath", "content", "lines"))})
        regex = re.compile(source.get("transform", {}).get("regex", "(?s)(.*)"))
        count = 0
        for name in names:
            path = out / name
            if extract == "jsonPath":
                found = self.by_path(json.loads(path.read_text()), what)
            elif what == "content":
                with PIL.Image.open(path) as image:
                    found = [image.copy()]
            else:
                texts = [name] if what == "fullpath" else path.read_text().splitlines()
                matches = [regex.match(text) for text in texts]
                self.assertNotIn(None, matches, (field["@id"], name))
                found = [match[1] for match in matches]
            for value in found:
                if "references" in field:
                    self.assertIn(value, splits)
                for one in self.flat(value) if field.get("repeated") else [value]:
                    self.assertTrue(VALUES[field["dataType"]](one), (field["@id"], one))
            count += len(found)
        self.assertGreater(count, 0, field["@id"])

    def by_path(self, document, path):
        """The values at `$.list[*].name`, or `$[*].name` of a list."""
        match = re.fullmatch(r"\$(?:\.(\w+))?\[\*\]\.(\w+)", path)
        entries = document[match[1]] if match[1] else document
        return [entry[match[2]] for entry in entries]

    def flat(self, value):
        return [one for part in value for one in self.flat(part)] if isinstance(value, list) else [value]

    def head(self, out):
        before, front, body = (out / "README.md").read_text().split("---\n", 2)
        self.assertEqual(before, "")
        return yaml.safe_load(front), body

    def test_croissant_of_each_format(self):
        for to in FORMATS:
            with self.subTest(to=to):
                self.check_croissant(demo.exported(to)[0], ["train", "val"])

    def test_croissant_of_other_files(self):
        for to, options in (("yolo", ["--images", "png"]), ("coco", ["--images", "png"]),
                            ("events", ["--layout", "mvsec"])):
            with self.subTest(to=to):
                self.check_croissant(demo.exported(to, *options, "--split", "val")[0], ["val"])

    def test_the_hub_finds_tasks_splits_and_a_licence_to_fill_in(self):
        for to in FORMATS:
            with self.subTest(to=to):
                out, _ = demo.exported(to)
                card, body = self.head(out)
                self.assertEqual((card["pretty_name"], card["size_categories"]), ("job", ["n<1K"]))
                self.assertEqual(set(card.get("task_categories", [])), TASKS.get(to, {"object-detection"}))
                self.assertEqual(card["tags"], ["event-camera", to, "eventgan"])
                # of rvt KITTI's sources alone
                known = to == "rvt"
                self.assertEqual(card["license"], "cc-by-nc-sa-3.0" if known else "unknown")
                self.assertIn("another one if these are not" if known else "To be filled in", body)
                licence = json.loads((out / "croissant.json").read_text()).get("license")
                self.assertEqual(licence, "https://spdx.org/licenses/CC-BY-NC-SA-3.0" if known else None)
                config, = card["configs"]
                listed = {entry["split"]: entry["path"] for entry in config["data_files"]}
                self.assertEqual(list(listed), ["train"] if to in ("mpii", "hpe") else ["train", "val"])
                for patterns in listed.values():
                    for pattern in patterns:
                        self.assertGreater(len(list(out.glob(pattern))), 0, pattern)

    def test_what_you_fill_in_stays(self):
        note = "note: README.md stays as you edited it"
        card = self.out / "README.md"
        self.assertNotIn(note, self.export("yolo", "--split", "val")[0])
        written = card.read_text()
        edited = written.replace("license: ", "license: other  # ")
        card.write_text(edited)
        self.assertIn(note, self.export("yolo", "--split", "val")[0])
        self.assertNotIn(note, self.export("yolo", "--split", "val")[0])
        self.assertEqual(card.read_text(), edited)
        for cut in (None, written[:100]):
            card.unlink()
            if cut is not None:
                card.write_text(cut)
            self.assertNotIn(note, self.export("yolo", "--split", "val")[0])
            self.assertEqual(card.read_text(), written)

    def test_a_split_with_a_hyphen(self):
        manifest = self.out.parent / "manifest.json"
        self.out.parent.mkdir(exist_ok=True)
        kitti = {"dataset": "kitti_object", "root": str(demo.folder / "demo/kitti/training"),
                 "pairs": program.pairs([1]), "split": "train-a"}
        manifest.write_text(json.dumps(program.manifest([kitti], generator={"kind": "difference"}, errors={
            "policy": "quarantine", "max_count": 9, "max_fraction": 1})))
        program.run("convert", manifest, "--progress", "none")
        for to in ("davis", "webdataset", "dsec"):
            out = self.out / to
            self.export(to, source=manifest.parent / "out", out=out)
            self.check_croissant(out, ["train-a"])
            entry, = self.head(out)[0]["configs"][0]["data_files"]
            self.assertEqual(entry["split"], "train_a")
            self.assertTrue(all("train-a" in pattern for pattern in entry["path"]))

    def test_the_card_counts(self):
        out, _ = demo.exported("webdataset")
        card, body = self.head(out)
        listed = sum((entry["path"] for entry in card["configs"][0]["data_files"]), [])
        self.assertEqual(sorted(listed), sorted(path.name for path in out.glob("*.tar")))
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in body.splitlines()
                if line.startswith("|")]
        for split in ("train", "val"):
            self.assertIn([split, "samples", str(len(of(split)))], rows)
            boxes = collections.Counter("boxes to ignore" if ignore else f"boxes of class {sample['classes'][i]}"
                                        for sample in of(split).values()
                                        for i, ignore in zip(sample["boxes"]["class_id"], sample["boxes"]["ignore"]))
            boxes["persons with joints"] = sum(len(sample["poses"]["joints"]) for sample in of(split).values())
            self.assertEqual({row[1]: int(row[2]) for row in rows if row[0] == split and row[1] != "samples"},
                             {what.replace("_", "\\_"): count for what, count in boxes.items() if count})
        self.assertIn(["kitti\\_object", "val", str(len(of("val"))), "1"], rows)
        plan = json.loads((demo.finalized / "dataset.json").read_text())["plan_hash"]
        self.assertIn(["SHA-256 of the plan", plan], rows)
        manifest = json.loads(body.split("```\n")[1])
        self.assertEqual(manifest["seed"], 7)


if __name__ == "__main__":
    program.main()
