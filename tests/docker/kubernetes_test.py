"""The Kubernetes jobs against the program: its exit codes, the variables it reads, its options."""

import os
import pathlib
import re
import subprocess
import unittest

import yaml

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
PROGRAM = os.environ["EVENTGAN_PROGRAM"]
FILES = SOURCE / "docker" / "kubernetes"


def read(name):
    documents = list(yaml.safe_load_all((FILES / name).read_text()))
    assert len(documents) == 1, name
    return documents[0]


def exit_codes():
    """ExitCode as the program has it: value by name. One without a value follows the one before."""
    text = (SOURCE / "pipeline" / "runtime" / "errors.h").read_text()
    body = re.sub(r"//.*", "", re.search(r"enum ExitCode[^{]*\{(.*?)\};", text, re.DOTALL)[1])
    return {name: int(value) for name, value in re.findall(r"(k\w+) = (\d+)", body)}


def variables_read():
    text = (SOURCE / "pipeline" / "conversion" / "worker_part.cc").read_text()
    return set(re.findall(r'"([A-Z][A-Z_]+)"', text))


def options_of(command):
    text = subprocess.run([PROGRAM, command, "--help"], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"--[a-z-]+", text))


def pod(job):
    return job["spec"]["template"]["spec"]


def container(job):
    (only,) = pod(job)["containers"]
    return only


class Kubernetes(unittest.TestCase):
    def setUp(self):
        self.convert, self.finalize, self.volume = map(read, ["convert-job.yaml", "finalize-job.yaml", "volume.yaml"])
        self.jobs = [self.convert, self.finalize]
        self.rules = self.convert["spec"]["podFailurePolicy"]["rules"]

    def action_for(self, code):
        """What the first rule that fits does about an exit code; None: the failure is counted."""
        for rule in self.rules:
            requirement = rule.get("onExitCodes")
            if requirement and (code in requirement["values"]) == (requirement["operator"] == "In"):
                return rule["action"]
        return None

    def test_kinds_and_versions(self):
        for job in self.jobs:
            self.assertEqual((job["apiVersion"], job["kind"]), ("batch/v1", "Job"))
        self.assertEqual((self.volume["apiVersion"], self.volume["kind"]), ("v1", "PersistentVolumeClaim"))

    def test_each_index_is_a_worker_with_failures_of_its_own(self):
        spec = self.convert["spec"]
        self.assertEqual(spec["completionMode"], "Indexed")
        self.assertLessEqual(spec["parallelism"], spec["completions"])
        self.assertGreaterEqual(spec["backoffLimitPerIndex"], 1)
        self.assertNotIn("backoffLimit", spec)  # would end the job for the failures of a few
        self.assertNotIn("maxFailedIndexes", spec)
        # Kubernetes sets this one itself.
        self.assertIn("JOB_COMPLETION_INDEX", variables_read())

    def test_the_parts_are_the_indexes(self):
        variables = {entry["name"]: entry.get("value") for entry in container(self.convert)["env"]}
        self.assertEqual(variables["SHARD_COUNT"], str(self.convert["spec"]["completions"]))
        self.assertIn("SHARD_COUNT", variables_read())
        # One that takes precedence would send all workers to one part.
        taken_first = {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID"}
        self.assertLessEqual(taken_first, variables_read())
        self.assertFalse(taken_first & variables.keys())

    def test_disruptions_are_ignored_first(self):
        for job in self.jobs:
            first = job["spec"]["podFailurePolicy"]["rules"][0]
            self.assertEqual(first,
                             {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget", "status": "True"}]})

    def test_what_each_exit_code_does(self):
        codes = exit_codes()
        self.assertEqual(self.action_for(codes["kUsage"]), "FailIndex")
        self.assertEqual(self.action_for(codes["kInputMissing"]), "FailIndex")
        self.assertEqual(self.action_for(codes["kTooManyFaults"]), "FailIndex")
        self.assertEqual(self.action_for(codes["kStopped"]), "Ignore")
        for counted in [codes["kFailed"], 128 + 9, 128 + 11]:
            self.assertIsNone(self.action_for(counted))
        decided = {codes[name] for name in ["kUsage", "kInputMissing", "kTooManyFaults", "kStopped"]}
        named = [value for rule in self.rules for value in rule.get("onExitCodes", {}).get("values", [])]
        self.assertEqual(sorted(named), sorted(decided))  # each once, none that the program does not have
        self.assertNotIn(codes["kComplete"], named)  # Kubernetes refuses 0 here

    def test_rules_are_well_formed(self):
        for job in self.jobs:
            self.assertEqual(pod(job)["restartPolicy"], "Never")  # the policy asks for it
            for rule in job["spec"]["podFailurePolicy"]["rules"]:
                self.assertEqual(len(rule), 2, "an action, and either exit codes or conditions")
                self.assertIn(rule["action"], ["Ignore", "FailIndex"])
                if "onExitCodes" in rule:
                    self.assertEqual(rule["onExitCodes"]["containerName"], container(job)["name"])
                    self.assertEqual(rule["onExitCodes"]["values"], sorted(set(rule["onExitCodes"]["values"])))

    def test_the_pod_outlives_the_grace_period(self):
        arguments = container(self.convert)["args"]
        grace_s = int(arguments[arguments.index("--grace") + 1])
        self.assertGreater(pod(self.convert)["terminationGracePeriodSeconds"], grace_s)

    def test_arguments_are_the_programs(self):
        for job in self.jobs:
            command, *arguments = container(job)["args"]
            self.assertTrue(all(isinstance(argument, str) for argument in arguments),
                            "YAML must not make numbers of them")
            self.assertLessEqual({a for a in arguments if a.startswith("--")}, options_of(command))
        arguments = container(self.convert)["args"]
        folder = arguments[arguments.index("--output") + 1]
        self.assertEqual(container(self.finalize)["args"][1], folder)
        names = {entry["name"] for entry in container(self.convert)["env"]}
        for name in re.findall(r"\$\((\w+)\)", " ".join(arguments)):
            self.assertIn(name, names)

    def test_both_jobs_see_the_same_volume(self):
        for job in self.jobs:
            (volume,) = pod(job)["volumes"]
            (mount,) = container(job)["volumeMounts"]
            self.assertEqual(volume["persistentVolumeClaim"]["claimName"], self.volume["metadata"]["name"])
            self.assertEqual(mount["name"], volume["name"])
            for argument in container(job)["args"]:
                if argument.startswith("/"):
                    self.assertTrue(argument.startswith(mount["mountPath"] + "/"), argument)
        self.assertEqual(self.volume["spec"]["accessModes"], ["ReadWriteMany"])

    def test_the_image_is_the_dockerfiles_and_has_no_rights(self):
        user, group = re.search(r"^USER (\d+):(\d+)$",
                                (SOURCE / "docker" / "Dockerfile").read_text(), re.MULTILINE).groups()
        version = re.search(r'(?m)^__version__ = "([\d.]+)"',
                            (SOURCE / "manifests" / "python" / "eventgan" / "__init__.py").read_text())[1]
        for job in self.jobs:
            security = pod(job)["securityContext"]
            self.assertEqual((security["runAsUser"], security["runAsGroup"]), (int(user), int(group)))
            self.assertEqual(security["fsGroup"], int(group))
            self.assertIs(security["runAsNonRoot"], True)
            only = container(job)
            self.assertEqual(only["image"], f"eventgan:{version}")
            self.assertIs(only["securityContext"]["readOnlyRootFilesystem"], True)
            self.assertIs(only["securityContext"]["allowPrivilegeEscalation"], False)
            self.assertEqual(only["securityContext"]["capabilities"], {"drop": ["ALL"]})
            self.assertEqual(only["resources"]["requests"], only["resources"]["limits"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
