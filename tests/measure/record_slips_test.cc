// Records that name cameras or lines wrongly, by rays through glass: refused with what is wrong;
// records whose LEDs fail or whose cameras moved are not.
#include "measure/record_slips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "measure/virtual_rig.h"
#include "tests/measure/fixtures.h"
#include "tests/measure/health_trial.h"
#include "tests/own_folder.h"

namespace unfurl::measure::record_slips_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

template <typename Trial>
std::string RefusalOf(const Trial& trial, const data::Rig& rig) {
  try {
    Reconstruct(trial, rig, {.workers = 1});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// Five cameras of 3000 pixels, and what they read of four marks.
struct Read {
  HealthTrial trial{5, 400, 3000};
  data::Rig rig;
  data::TrialReadings readings;
  Read() {
    Rng rng(3);
    rig = trial.DrawRig(&rng);
    readings = trial.Draw({}, 0.03, &rng);
  }
};
const Read& Shared() {
  static const Read read;
  return read;
}

TEST(CameraSlips, ExchangedAndMovedOn) {
  data::TrialReadings wrong = Shared().readings;
  EXPECT_EQ(RefusalOf(wrong, Shared().rig), "");
  std::swap(wrong.cameras[1], wrong.cameras[4]);
  EXPECT_THAT(RefusalOf(wrong, Shared().rig),
              AllOf(HasSubstr("'camera1' and 'camera4' are exchanged"), HasSubstr("names")));
  wrong = Shared().readings;
  std::rotate(wrong.cameras.begin(), wrong.cameras.begin() + 2, wrong.cameras.end());
  EXPECT_THAT(RefusalOf(wrong, Shared().rig), HasSubstr("moved on by"));
}

TEST(CameraSlips, RowsFromTheOtherEnd) {
  data::Rig reversed = Shared().rig;
  // The same camera turned by half a turn about its optical axis reads its row from the other end.
  data::RigCamera& camera = reversed.cameras[2];
  camera.R_CW.topRows<2>() *= -1.0;
  camera.u0_px = camera.pixels - 1.0 - camera.u0_px;
  for (double& term : camera.terms_px) term = 0.0;
  EXPECT_THAT(RefusalOf(Shared().readings, reversed),
              HasSubstr("camera 'camera2' is read from the other end"));
}

// A survey as a table need not state how long the rows are; the rig then has them end at the
// highest reading.
TEST(CameraSlips, RowsWhoseLengthIsAGuess) {
  for (const int cameras : {4, 5}) {
    constexpr int kPixels = 3000;
    const HealthTrial trial{static_cast<std::size_t>(cameras), 400, kPixels};
    Rng rng(7);
    data::Rig rig = trial.DrawRig(&rng);
    data::TrialReadings readings = trial.Draw({}, 0.03, &rng);
    readings.pixels.clear();
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      rig.cameras[c].pixels = kPixels - 40 - 13 * static_cast<int>(c);
    }
    EXPECT_EQ(RefusalOf(readings, rig), "");
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      data::TrialReadings wrong = readings;
      for (std::size_t i = 0; i < wrong.size() * rig.cameras.size() * wrong.most; ++i) {
        if (i / wrong.most % rig.cameras.size() == c) wrong.u_px[i] = kPixels - 1.0 - wrong.u_px[i];
      }
      EXPECT_THAT(RefusalOf(wrong, rig),
                  AllOf(HasSubstr("'" + rig.cameras[c].name + "' is read from the other end"),
                        HasSubstr("2999 - u")))
          << cameras << " " << c;
    }
  }
}

TEST(CameraSlips, ACameraThatMovedFarIsNone) {
  Rng rng(4);
  const data::TrialReadings moved = Shared().trial.Draw({.camera = 2, .px = 60.0}, 0.03, &rng);
  EXPECT_EQ(RefusalOf(moved, Shared().rig), "");
}

// Raw lines, and `name(line)` in place of what each was.
class Slots : public testing::Test {
 protected:
  Slots() {
    const data::Lab lab = ShippedLab();
    truth_ = MakeVirtualRig(lab);
    rig_ = FitRig(truth_, lab.volume_low, lab.volume_high);
    rig_.model_floor_px = 0.008;
    data::TrialWriter writer(folder_.File("trial.h5"), HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(0.4), writer, {}, nullptr);
    writer.Commit();
    const data::TrialReader trial(folder_.File("trial.h5"));
    header_ = trial.header();
    trial.Read(0, trial.size(), &block_);
  }

  std::string Named(const std::function<std::size_t(std::size_t)>& line_of) {
    data::TrialBlock block = block_;
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.slot[i] = block_.slot[std::min(line_of(i), block.size() - 1)];
    }
    data::TrialWriter writer(folder_.File("named.h5"), header_, {});
    writer.Append(block);
    writer.Commit();
    return RefusalOf(data::TrialReader(folder_.File("named.h5")), rig_);
  }

  OwnFolder folder_;
  VirtualRig truth_;
  data::Rig rig_;
  data::TrialHeader header_;
  data::TrialBlock block_;
};

TEST_F(Slots, OffByOne) {
  EXPECT_EQ(Named([](std::size_t i) { return i; }), "");
  EXPECT_THAT(Named([](std::size_t i) { return i + 1; }),
              AllOf(HasSubstr("lines named dark show a light"), HasSubstr("early by 1 line"),
                    HasSubstr("named.h5")));
  EXPECT_THAT(Named([](std::size_t i) { return i < 2 ? i + 3 : i - 2; }),
              HasSubstr("late by 2 lines"));
  EXPECT_THAT(Named([&](std::size_t i) { return i < block_.size() / 2 ? i : i + 1; }),
              AllOf(HasSubstr("from about"), HasSubstr("early by 1 line")));
}

// Readings of four marks in turn with a dark line after each round, flash i named as `name(i)` is.
data::TrialReadings Named(const std::function<std::size_t(std::size_t)>& name) {
  const data::TrialReadings& lit = Shared().readings;
  const std::size_t row = lit.cameras.size() * lit.most, marks = lit.slots.size();
  data::TrialReadings out = lit;
  out.slots.emplace_back(data::kDarkSlot);
  out.t.clear();
  out.slot.clear();
  out.u_px.clear();
  out.s_px.clear();
  for (std::size_t i = 0; i < lit.size(); ++i) {
    out.t.push_back(lit.t[i]);
    out.slot.push_back(lit.slot[i]);
    const auto from = static_cast<std::ptrdiff_t>(i * row);
    out.u_px.insert(out.u_px.end(), &lit.u_px[0] + from, &lit.u_px[0] + from + row);
    out.s_px.insert(out.s_px.end(), &lit.s_px[0] + from, &lit.s_px[0] + from + row);
    if (i % marks != marks - 1) continue;
    out.t.push_back(lit.t[i] + 1e-5);
    out.slot.push_back(static_cast<std::int32_t>(marks));
    out.u_px.insert(out.u_px.end(), row, std::nan(""));
    out.s_px.insert(out.s_px.end(), row, std::nan(""));
  }
  const std::vector<std::int32_t> slots = out.slot;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    out.slot[i] = slots[std::min(name(i), slots.size() - 1)];
  }
  return out;
}

TEST(SlotSlips, OfReadings) {
  const auto refusal = [](const std::function<std::size_t(std::size_t)>& name) {
    return RefusalOf(Named(name), Shared().rig);
  };
  EXPECT_EQ(refusal([](std::size_t i) { return i; }), "");
  EXPECT_THAT(refusal([](std::size_t i) { return i + 1; }),
              AllOf(HasSubstr("lines named dark show a light"), HasSubstr("early by 1 line")));
  EXPECT_THAT(refusal([](std::size_t i) { return i < 2 ? i + 3 : i - 2; }),
              HasSubstr("late by 2 lines"));
}

// Stretches of three slots and a dark one, in no order that comes again; `light(slot, stretch)`.
std::vector<NamedLines> Stretches(const std::function<bool(int, int)>& light) {
  std::vector<NamedLines> out;
  constexpr int kOrder[] = {0, 1, 0, 2, 3, 2, 1, 3, 0, 0, 1, 2, 3, 1, 2, 0};
  for (int k = 0; k < 10; ++k) {
    NamedLines& lines = out.emplace_back();
    lines.t = k;
    for (const int slot : kOrder) {
      lines.slot.push_back(slot);
      lines.flux.push_back(light(slot, k) ? 1000.0F : 3.0F);
    }
  }
  return out;
}

TEST(SlotSlips, DeadAndHiddenMarksAreNone) {
  const std::vector<std::string> names = {"a", "b", "c", "dark"};
  const std::vector<bool> dark = {false, false, false, true};
  const auto find = [&](const std::function<bool(int, int)>& light) {
    return FindSlotSlip(Stretches(light), names, dark);
  };
  EXPECT_FALSE(find([](int slot, int) { return slot < 3; }).found());
  EXPECT_FALSE(find([](int slot, int) { return slot == 1; }).found());  // two dead
  EXPECT_FALSE(find([](int, int) { return true; }).found());            // a lamp in the room
  EXPECT_FALSE(find([](int slot, int k) { return slot < 2 || (slot == 3 && k == 9); }).found());
  // b and dark exchanged: no shift of lines explains it.
  const RecordSlip slip = find([](int slot, int) { return slot != 1; });
  EXPECT_THAT(slip.what, AllOf(HasSubstr("those of 'b' none"), Not(HasSubstr("line by"))));
  EXPECT_THAT(slip.remedy, HasSubstr("order"));
}

}  // namespace
}  // namespace unfurl::measure::record_slips_test
