#!/usr/bin/env bash
# Runs tests of the viewer's page: run.sh lint|unit|page|measured|long STAGE PAGE SOURCE [KIROKU KIROKUD [VITEST OPTION...]]. Leaves with 77 where the page was not
# built, or no browser is there; with 1 where KIROKU_PAGE_REQUIRED is set, as in continuous integration.
# Of page, without options, two files run at a time, as each waits for servers and browsers half of its time; measured are those that look at what is seen
# and heard when, one at a time.
set -euo pipefail
project=$1 stage=$2
export KIROKU_PAGE=$3 KIROKU_SOURCE_DIR=$4 KIROKU_PROGRAM=${5:-} KIROKU_DAEMON_PROGRAM=${6:-}

missing() {
  [[ -z ${KIROKU_PAGE_REQUIRED-} ]] || { echo "failed, because KIROKU_PAGE_REQUIRED is set: $1" >&2; exit 1; }
  echo "skipped: $1"
  exit 77
}
[[ -x $stage/node_modules/.bin/vitest && -f $KIROKU_PAGE/index.html ]] || missing "the page was not built (see viewer/web/build.sh)"
if [[ $project == lint ]]; then
  cd "$stage"
  node_modules/.bin/eslint src tests vite.config.ts
  exec node_modules/.bin/prettier --check --log-level warn src tests vite.config.ts eslint.config.js '!src/api/schema.d.ts'
fi
options=()
if [[ $project != unit ]]; then
  KIROKU_BROWSER=$(command -v chromium) || missing "chromium is not installed"
  export KIROKU_BROWSER
  KIROKU_FIREFOX=$(command -v firefox-esr || command -v firefox || true)
  if [[ -n $KIROKU_FIREFOX ]]; then
    export KIROKU_FIREFOX
  elif [[ -n ${KIROKU_PAGE_REQUIRED-} ]]; then
    missing "firefox-esr is not installed"
  else
    echo "firefox-esr is not installed: its part of browsers.test.ts is skipped"
    unset KIROKU_FIREFOX
  fi
  options+=(--bail 8)
  measured=(page.test.ts sound.test.ts live.test.ts)
  if [[ $project == page && $# -lt 7 ]]; then
    options+=(--maxWorkers 2 --minWorkers 1)
    for file in "$KIROKU_SOURCE_DIR"/tests/page/*.test.ts; do
      file=${file##*/}
      [[ " ${measured[*]} " == *" $file "* ]] || options+=("$file")
    done
  else
    options+=(--no-file-parallelism)
    [[ $project != measured ]] || options+=("${measured[@]}")
  fi
  [[ $project != measured ]] || project=page
fi
cd "$stage"
exec node_modules/.bin/vitest run --project "$project" --reporter verbose "${options[@]}" "${@:7}"
