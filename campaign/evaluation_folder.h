#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace unfurl::campaign {

/// This process, as no other on any machine is called now: letters, digits, '-'.
std::string ProcessName();

/// A folder through which a fit has its evaluations carried out by other processes, on machines
/// that share it. A question is a file; whoever renames it has it; its answer is a file, whole or
/// not at all. Nothing listens to anything: who has died is known by a file that it no longer
/// touches, by the folder's own clock.
///
///     fit.json            what the questions are about
///     beat                touched by the fit; gone: it has ended
///     questions/N         to be answered
///     taken/N.WORKER      being answered; touched by the worker
///     answers/N           answered, until the fit has read it
class EvaluationFolder {
 public:
  /// For the fit: made anew. `identity`: all that an answer depends on but the question. Throws
  /// Error for a folder with anything else in it, and where a living fit has it.
  static EvaluationFolder Make(const std::string& path, const std::string& identity);
  /// For a worker. Throws Error where there is none, or one of another identity.
  static EvaluationFolder Open(const std::string& path, const std::string& identity);

  /// Where it is.
  const std::string& path() const { return path_; }

  // For the fit.
  void Ask(std::uint64_t question, const std::string& bytes) const;
  /// The answer, once; false: there is none yet. Throws Error(kMachine) for a damaged one.
  bool Fetch(std::uint64_t question, std::string* bytes) const;
  /// The fit lives.
  void Beat() const;
  /// Questions whose worker has not been heard of for `silence` seconds, which are asked again.
  std::vector<std::uint64_t> AskAgain(double silence) const;
  /// The fit has ended: the folder goes, and workers end; with `keep_logs` what they said stays.
  void Close(bool keep_logs) const;
  /// Of a file in which a worker's output is kept.
  std::string LogPath(const std::string& name) const;

  // For a worker; `worker`: a name of its own, of letters, digits, '-'.
  /// Some question that nobody has, as its number and its bytes; false: there is none. Throws
  /// Error(kMachine) for a damaged one.
  bool Take(const std::string& worker, std::uint64_t* question, std::string* bytes) const;
  /// The worker lives.
  void Working(const std::string& worker, std::uint64_t question) const;
  void Answer(const std::string& worker, std::uint64_t question, const std::string& bytes) const;
  /// The fit has ended, or has not been heard of for `silence` seconds.
  bool IsLeft(double silence) const;

  /// Seconds since a file was touched, by the folder's clock; infinite: it is not there.
  double Age(const std::filesystem::path& file) const;

 private:
  explicit EvaluationFolder(std::string path) : path_(std::move(path)) {}
  // Of all that is a fit's, with or without the logs.
  void Clear(bool keep_logs) const;
  std::filesystem::path In(const char* part, const std::string& name) const;

  std::string path_;
  std::shared_ptr<const int> lock_;  // descriptor, of the fit that has it
};

}  // namespace unfurl::campaign
