#include "correlate/fit/evaluation_store.h"

#include <cstring>

#include "base/error.h"

namespace unfurl::correlate {

namespace {

template <typename T>
void Put(std::string* out, T value) {
  static_assert(std::is_trivially_copyable_v<T>);
  out->append(reinterpret_cast<const char*>(&value), sizeof value);
}

void PutText(std::string* out, const std::string& text) {
  Put(out, static_cast<std::uint64_t>(text.size()));
  *out += text;
}

void PutNumbers(std::string* out, std::span<const double> values) {
  Put(out, static_cast<std::uint64_t>(values.size()));
  for (double value : values) Put(out, value);
}

// A row of a track, or a zero byte where it is nothing but zeros (a plane's z).
void PutRow(std::string* out, const Eigen::Matrix3Xd& m, Eigen::Index row) {
  // A mark without samples has no rows that could be named.
  const bool zero = m.cols() == 0 || (m.row(row).array() == 0.0).all();
  Put(out, static_cast<std::uint8_t>(zero ? 0 : 1));
  if (zero) return;
  for (Eigen::Index i = 0; i < m.cols(); ++i) Put(out, m(row, i));
}

// Begins the quantities of an answer, where there are any; what else may stand there is 0 or 1.
constexpr std::uint8_t kQuantities = 0xff;

class Source {
 public:
  explicit Source(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  T Get() {
    T value{};
    if (bytes_.size() < sizeof value) {
      good_ = false;
      return value;
    }
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }
  std::string Text() {
    const auto size = Get<std::uint64_t>();
    if (size > bytes_.size()) {
      good_ = false;
      return {};
    }
    std::string text(bytes_.substr(0, size));
    bytes_.remove_prefix(size);
    return text;
  }
  // Of a matrix of zeros.
  void Row(Eigen::Matrix3Xd* m, Eigen::Index row) {
    if (Get<std::uint8_t>() == 0) return;
    good_ = good_ && static_cast<std::size_t>(m->cols()) <= bytes_.size() / sizeof(double);
    if (!good_) return;
    for (Eigen::Index i = 0; i < m->cols(); ++i) (*m)(row, i) = Get<double>();
  }
  std::vector<double> Numbers() {
    const auto n = Get<std::uint64_t>();
    good_ = Room(n);
    std::vector<double> out(good_ ? n : 0);
    for (double& value : out) value = Get<double>();
    return out;
  }
  bool Room(std::uint64_t numbers) const {
    return good_ && numbers <= bytes_.size() / sizeof(double);
  }
  // The byte to come; 0: there is none.
  std::uint8_t Next() const {
    return bytes_.empty() ? std::uint8_t{0} : static_cast<std::uint8_t>(bytes_.front());
  }
  bool good() const { return good_; }
  bool empty() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
  bool good_ = true;
};

}  // namespace

std::string QuestionBytes(const Job& job) {
  std::string out;
  Put(&out, static_cast<std::uint64_t>(job.trial));
  Put(&out, static_cast<std::int32_t>(job.fidelity));
  Put(&out, static_cast<std::uint64_t>(job.theta.size()));
  for (double value : job.theta) Put(&out, value);
  std::uint64_t hash = data::Checksum({});
  for (std::size_t m = 0; m < job.stamps->marks.size(); ++m) {
    hash = data::Checksum(job.stamps->marks[m], hash);
    const std::vector<double>& t = job.stamps->t[m];
    hash = data::Checksum(
        std::string_view(reinterpret_cast<const char*>(t.data()), t.size() * sizeof(double)), hash);
  }
  for (const QuantityStamps& q : job.stamps->quantities) {
    for (const std::string* text : {&q.key, &q.quantity}) hash = data::Checksum(*text, hash);
    hash = data::Checksum(
        std::string_view(reinterpret_cast<const char*>(q.t.data()), q.t.size() * sizeof(double)),
        hash);
  }
  Put(&out, hash);
  return out;
}

std::string AnswerBytes(const Prediction& p) {
  std::string out;
  Put(&out, static_cast<std::int32_t>(p.status));
  PutText(&out, p.message);
  Put(&out, p.noise);
  Put(&out, static_cast<std::uint64_t>(p.marks.size()));
  for (const MarkMotion& motion : p.marks) {
    Put(&out, static_cast<std::uint64_t>(motion.p.cols()));
    for (Eigen::Index row = 0; row < 3; ++row) PutRow(&out, motion.p, row);
    for (Eigen::Index row = 0; row < 3; ++row) PutRow(&out, motion.v, row);
  }
  Put(&out, static_cast<std::uint64_t>(p.events.size()));
  for (const ModelEvent& event : p.events) {
    Put(&out, event.t);
    PutText(&out, event.kind);
    PutText(&out, event.where);
  }
  if (!p.quantities.empty()) {
    Put(&out, kQuantities);
    Put(&out, static_cast<std::uint64_t>(p.quantities.size()));
    for (const QuantityValues& q : p.quantities) {
      PutText(&out, q.key);
      Put(&out, static_cast<std::uint64_t>(q.values.size()));
      for (double value : q.values) Put(&out, value);
    }
  }
  // Of a model that starts in motion, which stamps it knows; all else know all, and say nothing.
  if (p.held_before) return out;
  for (const MarkMotion& motion : p.marks) {
    const std::vector<std::uint8_t> all(static_cast<std::size_t>(motion.p.cols()), 1);
    for (std::uint8_t known : motion.known.empty() ? all : motion.known) Put(&out, known);
  }
  return out;
}

bool ParseAnswer(std::string_view bytes, Prediction* p) {
  // Rows of zeros take no bytes: what a record claims is held against its size, and some more.
  constexpr std::uint64_t kZeros = std::uint64_t{1} << 20;
  std::uint64_t room = bytes.size() + kZeros;
  Source from(bytes);
  p->status = static_cast<ModelStatus>(from.Get<std::int32_t>());
  p->message = from.Text();
  p->noise = from.Get<double>();
  const auto marks = from.Get<std::uint64_t>();
  for (std::uint64_t m = 0; m < marks && from.good(); ++m) {
    const auto n = from.Get<std::uint64_t>();
    MarkMotion motion;
    if (n > room) return false;
    room -= n;
    motion.p.setZero(3, static_cast<Eigen::Index>(n));
    motion.v.setZero(3, static_cast<Eigen::Index>(n));
    for (Eigen::Index row = 0; row < 3; ++row) from.Row(&motion.p, row);
    for (Eigen::Index row = 0; row < 3; ++row) from.Row(&motion.v, row);
    p->marks.push_back(std::move(motion));
  }
  const auto events = from.Get<std::uint64_t>();
  for (std::uint64_t i = 0; i < events && from.good(); ++i) {
    ModelEvent event;
    event.t = from.Get<double>();
    event.kind = from.Text();
    event.where = from.Text();
    p->events.push_back(std::move(event));
  }
  if (from.Next() == kQuantities) {
    from.Get<std::uint8_t>();
    const auto count = from.Get<std::uint64_t>();
    for (std::uint64_t i = 0; i < count && from.good(); ++i) {
      QuantityValues q;
      q.key = from.Text();
      const auto n = from.Get<std::uint64_t>();
      if (!from.Room(n)) return false;
      q.values.resize(static_cast<Eigen::Index>(n));
      for (double& value : q.values) value = from.Get<double>();
      p->quantities.push_back(std::move(q));
    }
  }
  p->held_before = from.empty();
  if (p->held_before) return from.good();
  for (MarkMotion& motion : p->marks) {
    motion.known.resize(static_cast<std::size_t>(motion.p.cols()));
    for (std::uint8_t& known : motion.known) known = from.Get<std::uint8_t>();
  }
  return from.good();
}

std::string WholeQuestionBytes(const Job& job) {
  std::string out;
  Put(&out, static_cast<std::uint64_t>(job.trial));
  Put(&out, static_cast<std::int32_t>(job.fidelity));
  PutNumbers(&out, job.theta);
  const Stamps& stamps = *job.stamps;
  Put(&out, static_cast<std::uint64_t>(stamps.marks.size()));
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    PutText(&out, stamps.marks[m]);
    PutNumbers(&out, stamps.t[m]);
  }
  Put(&out, static_cast<std::uint64_t>(stamps.quantities.size()));
  for (const QuantityStamps& q : stamps.quantities) {
    PutText(&out, q.key);
    PutText(&out, q.quantity);
    PutNumbers(&out, q.t);
    Put(&out, q.needed);
  }
  return out;
}

bool ParseQuestion(std::string_view bytes, StoredQuestion* question) {
  Source from(bytes);
  question->trial = from.Get<std::uint64_t>();
  question->fidelity = static_cast<Fidelity>(from.Get<std::int32_t>());
  question->theta = from.Numbers();
  const auto marks = from.Get<std::uint64_t>();
  for (std::uint64_t m = 0; m < marks && from.good(); ++m) {
    question->stamps.marks.push_back(from.Text());
    question->stamps.t.push_back(from.Numbers());
  }
  const auto quantities = from.Get<std::uint64_t>();
  for (std::uint64_t i = 0; i < quantities && from.good(); ++i) {
    QuantityStamps q;
    q.key = from.Text();
    q.quantity = from.Text();
    q.t = from.Numbers();
    q.needed = from.Get<double>();
    question->stamps.quantities.push_back(std::move(q));
  }
  return from.good() && from.empty();
}

JournaledWorkers::JournaledWorkers(Workers& inner, data::Journal& journal)
    : inner_(inner), journal_(journal) {
  for (std::size_t i = 0; i < journal.size(); ++i) {
    const std::string record = journal.Read(i);
    Source from(record);
    const std::string question = from.Text();
    Prediction ignored;
    if (!from.good() || question.empty() ||
        !ParseAnswer(std::string_view(record).substr(sizeof(std::uint64_t) + question.size()),
                     &ignored)) {
      throw Error("holds something else than evaluations", journal.path(),
                  "start without --resume");
    }
    index_[question] = i;
  }
}

void JournaledWorkers::Run(std::span<const Job> jobs,
                           const std::function<void(std::size_t, Prediction)>& done) {
  std::vector<Job> fresh;
  std::vector<std::size_t> place;
  std::vector<std::string> question;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    std::string key = QuestionBytes(jobs[i]);
    std::size_t record = 0;
    bool known = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = index_.find(key);
      known = found != index_.end();
      if (known) record = found->second, ++answered_;
    }
    if (known) {
      const std::string bytes = journal_.Read(record);
      Prediction answer;
      ParseAnswer(std::string_view(bytes).substr(sizeof(std::uint64_t) + key.size()), &answer);
      done(i, std::move(answer));
      continue;
    }
    fresh.push_back(jobs[i]);
    place.push_back(i);
    question.push_back(std::move(key));
  }
  if (fresh.empty()) return;
  inner_.Run(fresh, [&](std::size_t i, Prediction answer) {
    std::string record;
    PutText(&record, question[i]);
    record += AnswerBytes(answer);
    const std::size_t index = journal_.Append(record);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      index_[question[i]] = index;
    }
    done(place[i], std::move(answer));
  });
}

}  // namespace unfurl::correlate
