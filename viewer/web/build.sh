#!/usr/bin/env bash
# Builds the page. Called by CMake: build.sh MODE SOURCE TESTS STAGE OUT STAMP. Nothing is written into the source tree: what is needed is copied to STAGE,
# npm's packages are put there, the page's files go to OUT, each with its compressed form beside it, and STAMP is touched. Where the packages cannot be
# fetched the rest of the build goes on without a page, unless MODE is ON.
set -euo pipefail
mode=$1 source_folder=$2 tests=$3 stage=$4 out=$5 stamp=$6

mkdir -p "$stage"
rm -rf "$stage/src" "$stage/public" "$stage/tests"
cp -r "$source_folder"/{package.json,package-lock.json,.npmrc,.prettierrc.json,tsconfig.json,vite.config.ts,eslint.config.js,index.html,src,public} "$stage/"
mkdir "$stage/tests"
cp -r "$tests/unit/viewer/web" "$stage/tests/unit"
cp -r "$tests/page" "$stage/tests/page"

cd "$stage"
lock=$(sha256sum package-lock.json)
if [[ ! -d node_modules || $(cat node_modules/.lock 2>/dev/null) != "$lock" ]]; then
  if ! npm ci --no-update-notifier >npm.log 2>&1; then
    tail -5 npm.log >&2
    echo "The viewer's page is not built: its packages could not be fetched ('npm ci' in $stage; its output is in $stage/npm.log)" >&2
    [[ $mode == AUTO ]] && exit 0
    exit 1
  fi
  echo "$lock" >node_modules/.lock
fi
node_modules/.bin/openapi-typescript "$source_folder/../api/openapi.json" --output src/api/schema.d.ts --array-length >openapi.log 2>&1 ||
  { cat openapi.log >&2; exit 1; }
node_modules/.bin/tsc --noEmit
node_modules/.bin/vite build --outDir "$out" --emptyOutDir --logLevel warn
find "$out" -type f ! -name '*.gz' ! -name '*.png' -exec gzip -9nk {} +
touch "$stamp"
