# One name per task, for https://just.systems: `just` lists them. Each is one of the scripts, which run without it, too.

# All tasks
default:
    @{{quote(just_executable())}} --list

# What a change must pass
ci:
    .ci/run

# All tests
test:
    scripts/test

# Tests of the Python module; arguments go to pytest
test-python *arguments:
    scripts/test-python {{arguments}}

# Tests of the C interface
test-c:
    scripts/test-c

# The npm package: build, test, …
web *arguments:
    scripts/web {{arguments}}

# The book and the references of all languages as a site
docs:
    scripts/docs

# The code of a page, as `just snippets sh docs/cli.md`
snippets *arguments:
    scripts/snippets {{arguments}}

# Names, links, imports, spelling and licences
tidy:
    scripts/names
    scripts/links
    scripts/architecture --check
    scripts/tidy

# The Blender extension
blender *arguments:
    scripts/blender {{arguments}}

# The files of a release: `just release` lists what it can make
release *arguments:
    scripts/release {{arguments}}

# The pictures of the documents: moving, cloth, examples or blender
picture name:
    scripts/picture {{name}}
