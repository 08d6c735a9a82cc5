#pragma once

namespace unfurl::sim {

// Which explicit pair takes the steps, 5(4) or 8(5,3), by what limits them. Per right side of a
// step, h |lambda| at the edge of stability is
//
//             real axis     imaginary axis (undamped vibrations)
//   5(4)      3.31 / 6      1.00 / 6
//   8(5,3)    6.40 / 12     5.97 / 12
//
// so at the edge 8(5,3) goes three times as far along a vibration, and loses 4% where
// only damping is fast; and its error there is far below what the tolerance allows. Away from the
// edge, where contacts set the steps, 5(4) is the cheaper one (docs/accuracy.md).
class PairChoice {
 public:
  // `at_edge`: begins with 8(5,3).
  explicit PairChoice(bool at_edge) : at_edge_(at_edge) {}

  // After an accepted step of the pair in use, with h |lambda| of the fastest motion and the cost
  // of the step in right sides. True: the other pair takes over.
  bool Note(double h_lambda, double cost);
  bool at_edge() const { return at_edge_; }
  // 8(5,3) takes the next steps: a method is left that had long steps.
  void TakeAtEdge();

 private:
  // Steps that are judged together, of which more than half decide: as MethodSwitch.
  static constexpr int kWindow = 64;
  // h |lambda| from which on 5(4) is near its edge on the imaginary axis, and below which 8(5,3)
  // has steps that 5(4) has at equal cost, half as long, inside it.
  static constexpr double kNearEdge = 0.8, kNearNone = 1.6;
  // Right sides with 8(5,3) before it is left; doubled each time, up to the most, so that changing
  // to and fro is a small part of any run.
  static constexpr double kFirstWait = 1000.0, kLongestWait = 32000.0;

  bool at_edge_;
  int steps_ = 0, told_ = 0;
  double since_ = 0.0, wait_ = kFirstWait;  // [right sides]
};

}  // namespace unfurl::sim
