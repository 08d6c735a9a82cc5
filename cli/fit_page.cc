#include "cli/fit_page.h"

#include "report/page.h"

namespace unfurl::cli {

void WriteFitPage(const std::string& path, const FitPageInput& input) {
  report::Page page("Fit: " + input.record.study);
  page.AddWords(report::Level::kGood, input.record.verdict, input.record.reasons);
  page.Write(path);
}

}  // namespace unfurl::cli
