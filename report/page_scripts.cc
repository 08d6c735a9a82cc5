#include "report/page_scripts.h"

#include <string_view>

#include "report/assets.h"

namespace unfurl::report {
namespace {

// dygraphs and three.js travel inside pages; their licence asks that its notice goes with them.
constexpr char kDygraphsAuthors[] =
    "/* dygraphs 2, (c) 2006-2023 Dan Vanderkam, Paul Felix, Robert Konigsberg, David Eberlein,\n"
    "Google, Inc., Petr Shevtsov, mirabilos, Deutsche Telekom LLCTO and contributors.\n";
constexpr char kThreeAuthors[] =
    "/* three.js and its OrbitControls, (c) 2010-2019 three.js authors.\n";
constexpr char kMitLicence[] =
    "MIT licence: Permission is hereby granted, free of charge, to any person obtaining a copy of\n"
    "this software and associated documentation files (the \"Software\"), to deal in the Software\n"
    "without restriction, including without limitation the rights to use, copy, modify, merge,\n"
    "publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons "
    "to\n"
    "whom the Software is furnished to do so, subject to the following conditions: The above\n"
    "copyright notice and this permission notice shall be included in all copies or substantial\n"
    "portions of the Software. THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY OF ANY KIND,\n"
    "EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS\n"
    "FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT\n"
    "HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF\n"
    "CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE\n"
    "USE OR OTHER DEALINGS IN THE SOFTWARE. */\n";

std::string Script(std::string_view code) {
  return "<script>\n" + std::string(code) + "\n</script>\n";
}

}  // namespace

std::string ScriptsOf(const Moving& what) {
  std::string html;
  if (what.charts || what.drawings || what.motions || what.spaces || what.tables) {
    html += Script(kToolsScript);
  }
  if (what.charts) {
    html += Script(std::string(kDygraphsAuthors) + kMitLicence + std::string(kDygraphsScript));
    html += Script("/* From dygraphs too, under the same licence. */\n" +
                   std::string(kSynchronizerScript));
    html += Script(kPageScript);
  }
  if (what.charts || what.drawings) html += Script(kFiguresScript);
  if (what.motions) html += Script(std::string(kMotionViewScript) + std::string(kMotionScript));
  if (what.spaces) {
    html += Script(std::string(kThreeAuthors) + kMitLicence + std::string(kThreeScript));
    html += Script(std::string(kOrbitScript) + std::string(kSpacePaceScript) +
                   std::string(kSpaceViewScript) + std::string(kSpaceScript));
  }
  return html;
}

}  // namespace unfurl::report
