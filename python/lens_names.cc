#include "python/lens_names.h"

#include <fmt/format.h>

#include "base/error.h"
#include "calib/model_order.h"
#include "measure/lens/lens.h"

namespace unfurl::python {

data::LensModel LensNamed(const std::string& name) {
  if (const auto lens = data::FindLensModel(name)) return *lens;
  std::string known;
  for (const data::LensNames& lens : data::kLensModels) {
    known += fmt::format("{}'{}'", known.empty() ? "" : ", ", lens.name);
  }
  throw Error(fmt::format("there is no lens model '{}'", name), "lens", "give one of " + known);
}

int OrderNamed(data::LensModel lens, const std::string& name) {
  if (name == "auto") return calib::kAutomaticOrder;
  std::string known = "'auto'";
  const auto orders = measure::OrdersOf(lens);
  for (std::size_t k = 0; k < orders.size(); ++k) {
    if (name == orders[k].name) return static_cast<int>(k);
    known += fmt::format(", '{}'", orders[k].name);
  }
  throw Error(fmt::format("the {} lens has no set of terms '{}'", data::NamesOf(lens).name, name),
              "order", "give one of " + known);
}

}  // namespace unfurl::python
