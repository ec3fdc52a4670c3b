#!/usr/bin/env bash
# Builds a release and checks it as its users will meet it: `make release`, or `make release REF=v0.1.0`.
# It publishes nothing. The packages are in dist/ afterwards; the last lines are their digests.
set -euo pipefail

ref=${1:-HEAD}
port=${PORT:-8765}
python=${PYTHON:-python3}
root=$(git rev-parse --show-toplevel)
work=$(mktemp -d)
demo=
finish() {
    [ -z "$demo" ] || kill -INT -- "-$demo" 2>/dev/null || true # web and worker, too
    wait
    rm -rf "$work"
}
trap finish EXIT
note() { printf -- '--- %s\n' "$*"; }
fail() { printf 'The release is not good: %s\n' "$*" >&2; exit 1; }

note "the files of $ref"
mkdir "$work/source" "$work/dist"
git -C "$root" archive "$ref" | tar -x -C "$work/source"
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' "$work/source/pyproject.toml")
[ "$ref" = HEAD ] || [ "$ref" = "v$version" ] || fail "the tag $ref holds version $version"
grep -q "^## .*\b${version//./\\.}\b" "$work/source/CHANGELOG.md" || fail "CHANGELOG.md has no entry for $version"

note "building tsttc $version"
"$python" -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check build twine
"$work/tools/bin/python" -m build --outdir "$work/dist" "$work/source" >"$work/build.log" 2>&1 ||
    { cat "$work/build.log" >&2; fail "the build ended with an error"; }
"$work/tools/bin/twine" check --strict "$work"/dist/*

note "contents"
wheel=$work/dist/tsttc-$version-py3-none-any.whl
sdist=$work/dist/tsttc-$version.tar.gz
packages=$("$python" -m zipfile -l "$wheel" | awk 'NR > 1 { split($1, a, "/"); print a[1] }' | sort -u | grep -v dist-info | xargs)
[ "$packages" = "$(ls -d "$work"/source/*/py.typed | xargs -n1 dirname | xargs -n1 basename | sort | xargs)" ] ||
    fail "the wheel holds the packages: $packages"
! tar -tzf "$sdist" | grep -E '/(tests|leaderboard|var)/' || fail "the sdist holds files of the server or of tests"
echo "$packages; $(tar -tzf "$sdist" | wc -l) files in the sdist"

note "installing in an empty environment"
for package in "$wheel" "$sdist"; do
    rm -rf "$work/empty"
    "$python" -m venv "$work/empty"
    "$work/empty/bin/pip" install --quiet --disable-pip-version-check "$package"
    (cd "$work" && "$work/empty/bin/tsttc" --version)
    (cd "$work" && "$work/empty/bin/tsttc" score "$work/source/examples/predictions.json" \
        --truth "$work/source/examples/truth.csv" >"$work/scores.txt") || fail "tsttc cannot score the example"
done

note "the demo of $ref"
setsid make -C "$work/source" demo PORT="$port" >"$work/demo.log" 2>&1 &
demo=$!
for ((tries = 0; tries < 300; tries++)); do
    curl --silent --fail --output "$work/page.html" "http://127.0.0.1:$port/board/demo/" &&
        grep -q '<table' "$work/page.html" && break
    kill -0 "$demo" 2>/dev/null || { cat "$work/demo.log" >&2; fail "the demo ended"; }
    sleep 1
done
((tries < 300)) || fail "the demo showed no board within five minutes"

note "good; the packages and their SHA-256"
mkdir -p "$root/dist"
cp "$wheel" "$sdist" "$root/dist/"
(cd "$root/dist" && sha256sum "$(basename "$wheel")" "$(basename "$sdist")")
