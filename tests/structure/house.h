#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace unfurl::structure {

// The rules of the house (docs/architecture.md) as functions of a file's path and text, so that
// each can be shown a violation. A finding is one line: "sim/joint.cc:3: ...".
using Findings = std::vector<std::string>;

// The room that a path relative to the root lies in; empty outside the rooms.
std::string RoomOf(const std::string& path);

// #include lines of a room's file: only rooms below it, and third-party headers only where they
// are wrapped. `path` is relative to the tree's root.
Findings CheckIncludes(const std::string& path, std::string_view text);

// Links in a room's CMakeLists.txt: the same arrows.
Findings CheckLinks(const std::string& path, std::string_view text);

// Sources that a CMakeLists.txt lists and that are not among `present` (file names in its folder),
// and those present that it does not list. Paths with a variable in them are passed over.
Findings CheckSources(const std::string& path, std::string_view text,
                      const std::vector<std::string>& present);

// Paths of one machine: nothing in the tree may name them; in documents, no temporary folder
// either.
Findings CheckMachinePaths(const std::string& path, std::string_view text);

// The machine's temporary folder named outside tests/own_folder.h, without the process's number
// beside it: CTest runs the tests of one suite at the same time.
Findings CheckSharedFolders(const std::string& path, std::string_view text);

// A file of tests that is in no namespace of its own name: files of tests are compiled together,
// and their helpers may have the same names.
Findings CheckOwnNamespace(const std::string& path, std::string_view text);

// More than 500 lines is a finding; `is_long` tells of more than 400.
Findings CheckLength(const std::string& path, std::string_view text, bool* is_long);

// Lines of a document have at most 120 characters; rows of tables, and lines without a blank to
// break at (links, long keys), are passed over.
Findings CheckLineLengths(const std::string& path, std::string_view text);

// A root is of `std::max(x, 0.0)`: with the 0 first, a variance that is no number gives an error of
// 0.
Findings CheckRoots(const std::string& path, std::string_view text);

// A `constexpr` number in a room has a comment: beside it, or above the run of those that share
// one. Versions of formats, k...Version, mean nothing but themselves.
Findings CheckConstants(const std::string& path, std::string_view text);

// Headers are guarded by #pragma once.
Findings CheckHeader(const std::string& path, std::string_view text);

// Targets of links in a Markdown file, without anchors; those that leave the tree are passed over.
std::vector<std::string> LinksOf(std::string_view text);

// Each package of a list (packages.txt, packages-test.txt) has a row in docs/dependencies.md.
Findings CheckPackages(const std::string& list, std::string_view packages,
                       std::string_view document);

}  // namespace unfurl::structure
