#!/usr/bin/env bash
# The documentation as a site, in target/docs: every warning is an error, a link between pages that leads nowhere among them. Exit 77 when
# Sphinx cannot be had.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

venv=$PWD/target/docs-venv
environment "$venv" 'sphinx==8.2.3' 'myst-nb==1.4.0' 'furo==2025.12.19'
prepare_only "$@"

# The notebooks stand beside the pages; what lies outside docs/ is a page of the repository.
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
cp -r docs roscausal_dashboard/assets/icon.svg "$source/"
mkdir "$source/docs/notebooks"
cp examples/*.ipynb "$source/docs/notebooks/"
find "$source/docs" -name '*.md' -exec sed -i -E 's#\]\((\.\./)+([^)]*)\)#](https://github.com/roscausal/roscausal/blob/main/\2)#g' {} +
if "$venv/bin/sphinx-build" -W --keep-going -q -b html "$source/docs" target/docs; then
  # The theme's captions are headings without a level, and no keyboard reaches its wide tables and listings.
  find target/docs -name '*.html' -exec sed -i -e 's/class="caption" role="heading"/class="caption" role="heading" aria-level="2"/' \
    -e 's/<div class="table-wrapper/<div tabindex="0" class="table-wrapper/' -e 's/<pre>/<pre tabindex="0">/' {} +
  # A picture that was not copied is no warning of Sphinx.
  pictures=$(cd target/docs && grep -oh '<img [^>]*>' ./*.html | grep -o 'src="[^":]*"' | cut -d '"' -f 2 | sort -u)
  for picture in $pictures; do
    [ -f "target/docs/$picture" ] && continue
    echo "0 passed, 1 failed: no picture $picture"
    exit 1
  done
  echo "1 passed, 0 failed: $(find target/docs -maxdepth 1 -name '*.html' | wc -l) pages in target/docs"
else
  echo "0 passed, 1 failed"
  exit 1
fi
