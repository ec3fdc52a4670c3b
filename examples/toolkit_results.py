"""The result file of the dataset's toolkit, by the toolkit's own rules and by the board's.

    python toolkit_results.py FOLDER results.json

FOLDER has the annotations (*.pkl) that the toolkit has read on this machine. It counts the sequences in the
order in which the file system lists the files, which differs between machines; a manifest counts them over
the sorted files. Without arguments, predictions.json of this folder is scored, which has natural keys.
"""

import sys
from pathlib import Path

import evaluator
from evaluator import convert, read_numbering

HERE = Path(__file__).parent


def with_natural_keys(results: bytes, *, annotations: Path) -> bytes:
    """The toolkit's result file, for the leaderboard; made where the toolkit has read the annotations."""
    return convert(results, natural_keys=read_numbering(annotations).natural_keys)


# {"0": 5.31, "1": -12.9, …}: what the toolkit writes and reads.
if len(sys.argv) > 1:
    annotations, result_file = map(Path, sys.argv[1:])
    truth = evaluator.read_truth(annotations)
    data = with_natural_keys(result_file.read_bytes(), annotations=annotations)
else:
    truth = evaluator.read_truth(HERE / "truth.csv")
    data = (HERE / "predictions.json").read_bytes()
predictions = evaluator.read_predictions(data, manifest=truth.manifest)

for protocol in ("toolkit", "tsttc-1"):
    report = evaluator.evaluate(predictions, truth, protocol=protocol)
    print(f"{protocol}: MiD {report.scores['overall'].mid:.2f}, RTE {report.scores['overall'].rte:.2f}%")

# The same from a shell: tsttc convert results.json --annotations FOLDER -o mine.json
#                        tsttc score mine.json --truth FOLDER
# And to the board:      tsttc submit mine.json --split val --method "Foo++" --wait
