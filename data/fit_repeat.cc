#include "data/fit_repeat.h"

namespace unfurl::data {

namespace {

using Repeat = FitRecord::Repeat;

// The matrices p x k, by their names in the file.
struct Named {
  const char* name;
  const char* what;
  Eigen::MatrixXd Repeat::*member;
};
constexpr Named kByTrial[] = {
    {"estimate", "values of each trial by itself", &Repeat::estimate},
    {"low95", "lower ends of their 95% intervals", &Repeat::low95},
    {"high95", "upper ends", &Repeat::high95},
    {"effect", "values of each trial by its own data and the others'", &Repeat::effect},
    {"effect_low95", "lower ends of their 95% intervals", &Repeat::effect_low95},
    {"effect_high95", "upper ends", &Repeat::effect_high95},
    {"left_out_p", "two-sided probability of the trial's value by the others", &Repeat::left_out_p},
    {"left_out_log_density", "logarithm of its density by the others",
     &Repeat::left_out_log_density},
};
constexpr Eigen::Index kNumbers = 9;  // columns of /repeat/numbers

}  // namespace

void WriteRepeat(const FitRecord& fit, H5Writer& w) {
  const Repeat& r = fit.repeat;
  if (r.empty()) return;
  const auto p = static_cast<Eigen::Index>(r.parameters.size());
  Eigen::MatrixXd numbers(p, kNumbers);
  for (Eigen::Index j = 0; j < p; ++j) {
    const Repeat::Parameter& q = r.parameters[static_cast<std::size_t>(j)];
    numbers.row(j) << (q.scatters ? 1.0 : 0.0), (q.log ? 1.0 : 0.0), q.scatter, q.scatter_low95,
        q.scatter_high95, q.visible, q.next_low95, q.next_high95, q.alike_p;
  }
  w.Write(
      {"/repeat/numbers", "1",
       "p rows: 1: it scatters; 1: its logarithm does; standard deviation from trial to trial, "
       "its 95% interval, one that the trials can show; 95% interval of the next trial's value; "
       "probability of Cochran's Q in trials that are alike"},
      numbers);
  w.Write({"/repeat/trials", "1", "names of the trials that count, k"}, r.trials);
  for (const Named& n : kByTrial) {
    w.Write({std::string("/repeat/") + n.name,
             "1",
             std::string(n.what) + ", p x k",
             {"/parameters/name", "/repeat/trials"}},
            r.*n.member);
  }
  w.Write({"/repeat/unlike_p",
           "1",
           "the least of a trial's left_out_p times their number",
           {"/repeat/trials"}},
          r.unlike_p);
  w.Write({"/repeat/alike_p", "1", "probability of Cochran's Q of all parameters"},
          std::vector<double>{r.alike_p});
  w.Write({"/repeat/next/marks", "1", "marks of the next trial"}, r.marks);
  w.Write({"/repeat/next/t", "s", "times on the model's clock"}, r.t);
  w.Write({"/repeat/next/mark", "1", "index into marks", {"/repeat/next/t"}}, r.mark);
  const std::vector<std::string> axes = {"/repeat/next/t", kAxisNames};
  w.Write({"/repeat/next/middle", "m", "middle of the 95% intervals, n x 3", axes},
          Eigen::MatrixXd(r.middle.transpose()));
  w.Write({"/repeat/next/low", "m", "their lower ends, n x 3", axes},
          Eigen::MatrixXd(r.low.transpose()));
  w.Write({"/repeat/next/high", "m", "their upper ends, n x 3", axes},
          Eigen::MatrixXd(r.high.transpose()));
}

void ReadRepeat(const H5Reader& r, FitRecord* fit) {
  if (!r.Has("/repeat/trials")) return;
  Repeat& out = fit->repeat;
  const Eigen::MatrixXd numbers = r.ReadMatrix("/repeat/numbers");
  for (Eigen::Index j = 0; j < numbers.rows(); ++j) {
    const auto n = numbers.row(j).array();
    out.parameters.push_back({n(0) != 0.0, n(1) != 0.0, n(2), n(3), n(4), n(5), n(6), n(7), n(8)});
  }
  out.trials = r.ReadStrings("/repeat/trials");
  for (const Named& n : kByTrial) out.*n.member = r.ReadMatrix(std::string("/repeat/") + n.name);
  out.unlike_p = r.ReadDoubles("/repeat/unlike_p");
  out.alike_p = r.ReadDoubles("/repeat/alike_p").at(0);
  out.marks = r.ReadStrings("/repeat/next/marks");
  out.t = r.ReadDoubles("/repeat/next/t", "s");
  out.mark = r.ReadInts("/repeat/next/mark");
  out.middle = r.ReadMatrix("/repeat/next/middle", "m").transpose();
  out.low = r.ReadMatrix("/repeat/next/low", "m").transpose();
  out.high = r.ReadMatrix("/repeat/next/high", "m").transpose();
}

}  // namespace unfurl::data
