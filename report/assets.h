#pragma once

#include <string_view>

namespace unfurl::report {

// Files that every page carries inside; the build turns them into strings
// (cmake/UnfurlEmbed.cmake).
extern const std::string_view kDygraphsScript;      // without its comments
extern const std::string_view kSynchronizerScript;  // dygraphs' own extra: zoom several together
extern const std::string_view kDygraphsStyle;
extern const std::string_view kPageScript;
extern const std::string_view kPageStyle;
extern const std::string_view kPaperStyle;       // after kPageStyle
extern const std::string_view kToolsScript;      // before those that follow
extern const std::string_view kFiguresScript;    // after kPageScript
extern const std::string_view kThreeScript;      // three.js, for views in space
extern const std::string_view kOrbitScript;      // three.js' own extra: turning by mouse and touch
extern const std::string_view kSpacePaceScript;  // before kSpaceViewScript
extern const std::string_view kSpaceViewScript;  // before kSpaceScript
extern const std::string_view kSpaceScript;
extern const std::string_view kMotionViewScript;  // before kMotionScript
extern const std::string_view kMotionScript;

}  // namespace unfurl::report
