// `reconstruct --live` and `stream` as programs: pipes, ports, streams that are none, signals.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "data/tracks.h"
#include "tests/cli/program.h"

namespace unfurl::cli::live_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// A program beside the test, its input a pipe of ours, its outputs files.
class Beside {
 public:
  Beside(const std::vector<std::string>& arguments, const std::filesystem::path& folder)
      : out_(folder / "beside.out"), err_(folder / "beside.err") {
    std::signal(SIGPIPE, SIG_IGN);  // a program that has ended is no fault of the test
    int ends[2] = {-1, -1};
    if (pipe2(ends, O_CLOEXEC) != 0) std::abort();
    child_ = fork();
    if (child_ == 0) {
      dup2(ends[0], STDIN_FILENO);
      dup2(open(out_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600), STDOUT_FILENO);
      dup2(open(err_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600), STDERR_FILENO);
      if (chdir(folder.c_str()) != 0) _exit(120);
      std::vector<char*> argv = {const_cast<char*>(UNFURL_PROGRAM)};
      for (const std::string& word : arguments) argv.push_back(const_cast<char*>(word.c_str()));
      argv.push_back(nullptr);
      execv(UNFURL_PROGRAM, argv.data());
      _exit(121);
    }
    close(ends[0]);
    input_ = ends[1];
  }
  ~Beside() {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    if (input_ >= 0) close(input_);
  }
  void Send(const std::string& bytes) const {
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t n = write(input_, &bytes[at], bytes.size() - at);
      if (n <= 0) return;  // it has ended, which the test will see
      at += static_cast<std::size_t>(n);
    }
  }
  void Hang() {
    close(input_);
    input_ = -1;
  }
  void Signal(int number) const { kill(child_, number); }
  Outcome End() {
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    Outcome outcome;
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    outcome.out = Out();
    outcome.err = Slurp(err_);
    return outcome;
  }
  std::string Out() const { return Slurp(out_); }
  // Until the output has these words; what it has then.
  std::string Await(const std::string& words) const {
    for (int k = 0; k < 2000 && Out().find(words) == std::string::npos; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return Out();
  }

 private:
  static std::string Slurp(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }
  std::filesystem::path out_, err_;
  pid_t child_ = -1;
  int input_ = -1;
};

std::vector<json> LinesOf(const std::string& text) {
  EXPECT_TRUE(text.empty() || text.back() == '\n') << "half a line";
  std::vector<json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(json::parse(line, nullptr, false));
    EXPECT_FALSE(lines.back().is_discarded()) << line;
  }
  return lines;
}

class LiveProgram : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    // A second of the shipped rig's four cameras, of a motion that is quick to simulate.
    ASSERT_EQ(Run({"new", "study", "--quiet"}).code, 0);
    ASSERT_EQ(Run({"simulate", "study/scene.toml", "-o", "run.h5", "--duration", "0.6"}).code, 0);
    ASSERT_EQ(Run({"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "trial.h5", "--set",
                   R"(strobe.slots=["elbow","tip","dark"])"})
                  .code,
              0);
    stream_ = Run({"stream", "trial.h5"}).out;
    header_ = stream_.find('\n') + 1;
  }
  std::vector<std::string> Live(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"reconstruct", "--live", "--rig", Shipped("rig.h5")};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Outcome Fed(const std::string& bytes, const std::vector<std::string>& more = {}) const {
    Beside program(Live(more), folder_);
    program.Send(bytes);
    program.Hang();
    return program.End();
  }
  std::string stream_;
  std::size_t header_ = 0;
};

TEST_F(LiveProgram, GivesWhatReconstructGives) {
  ASSERT_EQ(Run({"reconstruct", "trial.h5", "--rig", Shipped("rig.h5")}).code, 0);
  const data::Tracks tracks = data::ReadTracks((folder_ / "tracks.h5").string());
  const Outcome live = Fed(stream_, {"--like", "trial.h5", "--report", "live.html"});
  EXPECT_EQ(live.code, 0) << live.err;
  EXPECT_EQ(live.err, "");
  std::size_t i = 0;
  json end;
  for (const json& line : LinesOf(live.out)) {
    if (line["type"] == "end") end = line;
    if (line["type"] != "sample") continue;
    ASSERT_LT(i, tracks.size());
    EXPECT_EQ(line["t"], tracks.t[i]);
    EXPECT_EQ(line["mark"], tracks.marks[static_cast<std::size_t>(tracks.mark[i])]);
    EXPECT_EQ(line["status"], data::Name(tracks.status[i]));
    for (Eigen::Index k = 0; data::Usable(tracks.status[i]) && k < 3; ++k) {
      EXPECT_EQ(line["p"][static_cast<std::size_t>(k)].get<double>(),
                tracks.p(k, static_cast<Eigen::Index>(i)));
    }
    ++i;
  }
  EXPECT_EQ(i, tracks.size());
  EXPECT_EQ(end["whole"], true);
  EXPECT_EQ(end["samples"], tracks.size());
  EXPECT_THAT(Get("live.html"), HasSubstr("the stream has ended"));
  // The same from the file, as if its lines came now.
  const Outcome file = Run({"reconstruct", "trial.h5", "--live", "--rig", Shipped("rig.h5")});
  EXPECT_EQ(file.code, 0) << file.err;
  EXPECT_EQ(LinesOf(file.out).back()["samples"], tracks.size());
}

TEST_F(LiveProgram, RefusesStreamsThatAreNone) {
  const auto refused = [&](const std::string& bytes, const std::string& words, int code = 2) {
    const Outcome outcome = Fed(bytes);
    EXPECT_EQ(outcome.code, code);
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
    LinesOf(outcome.out);
  };
  refused("", "ends before it begins");
  refused("GET / HTTP/1.1\r\n\r\n", "does not begin as a stream");
  refused(stream_.substr(0, stream_.size() / 2), "is cut short");
  std::string other = stream_;
  other.replace(other.find("\"version\":1"), 11, "\"version\":9");
  refused(other, "is version 9");
  std::string strange = stream_;
  strange.replace(strange.find(":[\"") + 3, 1, "Q");
  refused(strange, "was recorded by the cameras");
  std::string huge = stream_;
  huge.replace(huge.find("\"active\":2160"), 13, "\"active\":9999");
  refused(huge, "9999 active pixels");
  refused(huge.substr(0, huge.find('\n') + 1), "9999 active pixels");  // no line is waited for
  std::string garbage = stream_;
  garbage.replace(stream_.size() / 2, 4000, std::string(4000, '\x5a'));
  refused(garbage, ": line ");
}

// What came before the cut was worked on, and is whole.
TEST_F(LiveProgram, WritesAllThatCameBeforeACut) {
  const Outcome whole = Fed(stream_), cut = Fed(stream_.substr(0, stream_.size() / 2));
  const std::vector<json> lines = LinesOf(cut.out);
  ASSERT_FALSE(lines.empty());
  EXPECT_EQ(lines.back()["whole"], false);
  const auto half = LinesOf(whole.out).back()["lines"].get<std::size_t>() / 2;
  EXPECT_NEAR(lines.back()["lines"].get<double>(), static_cast<double>(half), 2.0);
}

TEST_F(LiveProgram, TakesOneClientOfAPort) {
  Beside program(Live({"--listen", "127.0.0.1:0"}), folder_);
  const std::string first = program.Await("listening");
  const std::string address = LinesOf(first).front()["address"];
  Beside slow({"stream", "trial.h5", "--to", address, "--pace", "1"}, folder_ / "study");
  EXPECT_EQ(slow.End().code, 2) << "no such file there";
  // A connection that says nothing is the client; the next one is told so.
  const int client = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at = {};
  at.sin_family = AF_INET;
  at.sin_port =
      htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(connect(client, reinterpret_cast<sockaddr*>(&at), sizeof at), 0);
  ASSERT_GT(send(client, stream_.data(), header_, 0), 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const Outcome second = Run({"stream", "trial.h5", "--to", address});
  EXPECT_EQ(second.code, 2);
  EXPECT_EQ(std::count(second.err.begin(), second.err.end(), '\n'), 1) << second.err;
  for (std::size_t sent = header_; sent < stream_.size();) {
    const ssize_t n = send(client, &stream_[sent], stream_.size() - sent, MSG_NOSIGNAL);
    ASSERT_GT(n, 0);
    sent += static_cast<std::size_t>(n);
  }
  close(client);
  const Outcome outcome = program.End();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(LinesOf(outcome.out).back()["whole"], true);
}

TEST_F(LiveProgram, GivesUpOnASilentRecorder) {
  Beside program(Live({"--timeout", "0.3"}), folder_);
  program.Send(stream_.substr(0, stream_.size() / 3));
  const Outcome outcome = program.End();
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("no line came for 0.3 s"));
  EXPECT_EQ(LinesOf(outcome.out).back()["whole"], false);
}

TEST_F(LiveProgram, EndsAtSignalsWithWholeLines) {
  for (const auto& [number, code] : {std::pair{SIGTERM, 143}, std::pair{SIGINT, 130}}) {
    Beside program(Live({"--report", "live.html"}), folder_);
    program.Send(stream_.substr(0, stream_.size() / 2));
    program.Await("\"sample\"");
    const auto before = std::chrono::steady_clock::now();
    program.Signal(number);
    const Outcome outcome = program.End();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - before;
    EXPECT_EQ(outcome.code, code);
    RecordProperty("seconds", std::to_string(took.count()));
    EXPECT_THAT(outcome.err, HasSubstr("interrupted after"));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_EQ(LinesOf(outcome.out).back()["why"], "interrupted");
    EXPECT_THAT(Get("live.html"), HasSubstr("interrupted"));
  }
}

TEST_F(LiveProgram, OptionsThatDoNotFitAreRefused) {
  const auto before = Files();
  ExpectRefused(Run(Live({"-o", "tracks.h5"})), {"--output", "whole record"}, before);
  ExpectRefused(Run(Live({"--smooth"})), {"--smooth"}, before);
  ExpectRefused(Run(Live({"--listen", "nowhere"})), {"nowhere", "no address"}, before);
  ExpectRefused(Run(Live({"--timeout", "-1"})), {"--timeout"}, before);
  ExpectRefused(Run({"reconstruct", "trial.h5", "--rig", Shipped("rig.h5"), "--listen", "a:1"}),
                {"--listen", "--live only"}, before);
  ExpectRefused(Run({"reconstruct", "--rig", Shipped("rig.h5")}), {"TRIAL is required"}, before);
  ExpectRefused(Run({"stream", "trial.h5", "--to", "127.0.0.1:1"}), {"127.0.0.1:1"}, before);
  ExpectRefused(Run({"stream", "trial.h5", "--pace", "-2"}), {"--pace"}, before);
}

}  // namespace
}  // namespace unfurl::cli::live_test
