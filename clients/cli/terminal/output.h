#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/base/text_file.h"
#include "server/report/error_json.h"

namespace trammel::cli {

/// Writes `text` whole or not at all; `-` is standard output.
[[nodiscard]] Status write_output(const std::string& path, const std::string& text);

/// write_text_files(); pages among them are linked with those beside them, both ways.
[[nodiscard]] Status write_files(const std::vector<TextFile>& files);

/// Writes `value` to the path of --json; does nothing for an empty path.
[[nodiscard]] Status write_json(const std::string& path, const nlohmann::ordered_json& value);

/// Writes a refusal as `{"error": {...}}` to standard output, if the JSON result would have gone
/// there and none was written yet. Files stay as they were.
void tell_refusal(const Error& error, const std::string& json_path);

/// Text for people on standard output. Control characters of foreign text are spelled out. The text
/// is painted() if the output is a terminal with colours and NO_COLOR is not set. It is left out
/// when a result for programs goes to standard output (`paths`: where results go).
void tell(const std::string& text, std::initializer_list<std::string> paths);

/// A file that a command reads or writes, and the option that names it.
struct NamedFile {
  std::string option, path;
};

/// The output files of one command: checked before the work, written after it, all or none.
class Outputs {
 public:
  /// An empty path is no output. `may_replace`: the input that it may be the new state of.
  void add(const std::string& option, const std::string& path, const std::string& may_replace = "");
  /// Refuses as wrong usage two outputs in one file or on standard output, and an output that is
  /// also an input.
  [[nodiscard]] Status check_apart(const std::vector<NamedFile>& inputs) const;
  /// Likewise, and as kRefused an output that cannot be written.
  [[nodiscard]] Status check(const std::vector<NamedFile>& inputs) const;
  /// The text of an added output; an output without text is not written.
  void put(const std::string& option, std::string text);
  [[nodiscard]] Status write() const;

 private:
  struct Output {
    NamedFile file;
    std::string may_replace;
    std::optional<std::string> text;
  };
  std::vector<Output> outputs_;
};

/// A text for the file that an option names; an empty path is no output.
struct OutputText {
  std::string option, path, text;
};
/// Writes all of them, or none.
[[nodiscard]] Status write_together(const std::vector<OutputText>& texts);

/// The text in bold red if standard error is a terminal with colours and NO_COLOR is not set;
/// otherwise unchanged.
[[nodiscard]] std::string emphasised(const std::string& text);

/// Lines for a terminal with colours. A line that begins with a state is green, yellow or red.
[[nodiscard]] std::string painted(const std::string& lines);

/// `, about 40 s left`, from how long a share of the work took; empty while that says little (under
/// 2 s or 2 %) and at the end.
[[nodiscard]] std::string time_left(double elapsed_s, double share);

/// One line on standard error that is overwritten as work goes on, with the remaining time. Silent
/// if standard error is not a terminal.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();  ///< clears the line
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// `share` of all the work done, in [0, 1].
  void show(const std::string& what, double share);

 private:
  bool terminal_;
  std::string shown_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  double share_ = 0;
};

}  // namespace trammel::cli
