#include "calib/tally.h"

#include <iterator>
#include <utility>

#include "calib/verdict.h"

namespace unfurl::calib {

void Conclude(Tally tally, data::Rig* rig) {
  rig->verdict = !tally.no.empty() ? kDoNotUse : !tally.care.empty() ? kWithCare : kGood;
  rig->reasons = std::move(tally.no);
  for (std::vector<std::string>* next : {&tally.care, &tally.fine}) {
    rig->reasons.insert(rig->reasons.end(), std::make_move_iterator(next->begin()),
                        std::make_move_iterator(next->end()));
  }
}

}  // namespace unfurl::calib
