"""The result file of the dataset's toolkit, as it is: by the toolkit's own rules and by the board's."""

from pathlib import Path

import evaluator

HERE = Path(__file__).parent

# A CSV file, or the folder of the toolkit's annotations (*.pkl). The toolkit numbers the sequences of a
# folder as the file system lists it; the leaderboard's manifest says which number is which.
truth = evaluator.read_truth(HERE / "truth.csv")

# {"0": 5.31, "1": -12.9, …}: what the toolkit writes and reads.
result_file = HERE / "predictions.json"
predictions = evaluator.read_predictions(result_file.read_bytes(), manifest=truth.manifest)

for protocol in ("toolkit", "tsttc-1"):
    report = evaluator.evaluate(predictions, truth, protocol=protocol)
    print(f"{protocol}: MiD {report.scores['overall'].mid:.2f}, RTE {report.scores['overall'].rte:.2f} %")

# The same from a shell: tsttc score predictions.json --truth truth.csv
# And to the board:      tsttc submit predictions.json --split val --method "Foo++" --wait
