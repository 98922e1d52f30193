#include "clients/cli/terminal/output.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <string_view>

#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/report/pages_beside.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

bool is_standard_output(const std::string& path) { return path == "-" || path == "/dev/stdout"; }

/// True if writing one file would change the other. Devices do not count, since their contents are
/// not read back.
bool same_file(const std::string& a, const std::string& b) {
  if (is_standard_output(a) || is_standard_output(b))
    return is_standard_output(a) && is_standard_output(b);
  std::error_code error;
  if (fs::is_character_file(a, error)) return false;
  // Names of a file that does not exist yet, `p` and `./p`, are the same only as absolute paths.
  const auto place = [&](const std::string& path) {
    return fs::weakly_canonical(fs::absolute(path, error), error);
  };
  return fs::equivalent(a, b, error) || place(a) == place(b);
}

/// True if the stream is a terminal that shows colours, and the user has not refused them.
bool shows_colours(int stream) {
  const char* terminal = std::getenv("TERM");
  const char* plain = std::getenv("NO_COLOR");
  return ::isatty(stream) == 1 && terminal != nullptr && std::strcmp(terminal, "dumb") != 0 &&
         (plain == nullptr || *plain == '\0');
}

/// True if this process has written a result to standard output. A second one after it would not be
/// valid JSON.
bool& standard_output_is_taken() {
  static bool taken = false;
  return taken;
}

}  // namespace

Status write_files(const std::vector<TextFile>& files) {
  TRY(write_text_files(files));
  for (const TextFile& file : files) link_pages_beside(file.text, file.path);
  return {};
}

Status write_output(const std::string& path, const std::string& text) {
  if (path != "-") return write_files({{path, text}});
  standard_output_is_taken() = true;
  const bool written =
      std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (written) return {};
  return refused("cannot be written: {}", std::strerror(errno))
      .in("standard output")
      .next("see where it goes: the disk may be full, or the reader gone");
}

void tell_refusal(const Error& error, const std::string& json_path) {
  if (!is_standard_output(json_path) || standard_output_is_taken()) return;
  static_cast<void>(write_json(json_path, {{"error", error_json(error)}}));
}

Status write_json(const std::string& path, const nlohmann::ordered_json& value) {
  if (path.empty()) return {};
  return write_output(path, json_text(value));
}

void tell(const std::string& text, std::initializer_list<std::string> paths) {
  if (std::any_of(paths.begin(), paths.end(), is_standard_output)) return;
  const std::string lines = shown_lines(text);
  std::fputs((shows_colours(STDOUT_FILENO) ? painted(lines) : lines).c_str(), stdout);
}

void Outputs::add(const std::string& option, const std::string& path,
                  const std::string& may_replace) {
  if (!path.empty()) outputs_.push_back({{option, path}, may_replace, {}});
}

Status Outputs::check_apart(const std::vector<NamedFile>& inputs) const {
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    const auto& [option, path] = outputs_[k].file;
    for (std::size_t i = 0; i < k; ++i) {
      if (!same_file(path, outputs_[i].file.path)) continue;
      return failure(ErrorCode::kUsage, "{} and {} both go to {}", outputs_[i].file.option, option,
                     is_standard_output(path) ? "standard output" : path)
          .of(option)
          .with_text(path)
          .next("name another file for one of them");
    }
    for (const NamedFile& input : inputs) {
      if (input.path.empty() || input.option == outputs_[k].may_replace ||
          !same_file(path, input.path))
        continue;
      return failure(ErrorCode::kUsage, "{} {} would overwrite {}", option, path, input.option)
          .of(option)
          .with_text(path)
          .next("name another file");
    }
  }
  return {};
}

Status Outputs::check(const std::vector<NamedFile>& inputs) const {
  TRY(check_apart(inputs));
  for (const Output& output : outputs_) {
    if (is_standard_output(output.file.path)) continue;
    TRY(check_writable(output.file.path));
  }
  return {};
}

void Outputs::put(const std::string& option, std::string text) {
  for (Output& output : outputs_) {
    if (output.file.option == option) output.text = std::move(text);
  }
}

Status Outputs::write() const {
  std::vector<TextFile> files;
  for (const Output& output : outputs_) {
    if (output.text && output.file.path != "-") files.push_back({output.file.path, *output.text});
  }
  TRY(write_files(files));
  for (const Output& output : outputs_) {
    if (output.text && output.file.path == "-") return write_output("-", *output.text);
  }
  return {};
}

Status write_together(const std::vector<OutputText>& texts) {
  Outputs outputs;
  for (const OutputText& one : texts) {
    outputs.add(one.option, one.path);
    outputs.put(one.option, one.text);
  }
  return outputs.write();
}

std::string emphasised(const std::string& text) {
  return shows_colours(STDERR_FILENO) ? "\033[1;31m" + text + "\033[0m" : text;
}

std::string painted(const std::string& lines) {
  constexpr const char *kGood = "\033[32m", *kDoubtful = "\033[33m", *kBad = "\033[31m";
  constexpr std::pair<std::string_view, const char*> kStates[] = {
      {"* ", kGood},          {"healthy:", kGood},     {"cannot_tell:", kDoubtful},
      {"note:", kDoubtful},   {"warning:", kDoubtful}, {"in quarantine", kDoubtful},
      {"changed:", kBad},     {"stop:", kBad},         {"failed", kBad},
      {"not reachable", kBad}};
  std::istringstream in(lines);
  std::string all;
  for (std::string line; std::getline(in, line);) {
    const auto state = std::find_if(std::begin(kStates), std::end(kStates),
                                    [&](const auto& one) { return line.starts_with(one.first); });
    all += state == std::end(kStates) ? line : state->second + line + "\033[0m";
    all += "\n";
  }
  if (!lines.ends_with('\n') && !all.empty()) all.pop_back();
  return all;
}

std::string time_left(double elapsed_s, double share) {
  if (elapsed_s < 2 || share < 0.02 || share >= 1) return "";
  const double left = elapsed_s * (1 - share) / share;
  if (left < 1) return "";
  if (left < 90) return fmt::format(", about {:.0f} s left", left);
  if (left < 90 * 60) return fmt::format(", about {:.0f} min left", left / 60);
  return fmt::format(", about {:.1f} h left", left / 3600);
}

ProgressLine::ProgressLine() : terminal_(::isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (!shown_.empty()) std::fputs("\r\033[K", stderr);
}

void ProgressLine::show(const std::string& what, double share) {
  if (!terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (share < share_) began_ = now;  // the work begins again
  share_ = share;
  const std::string left = time_left(std::chrono::duration<double>(now - began_).count(), share);
  const std::string line =
      fmt::format("{} {:.0f} %{}", shown(what), 100 * std::clamp(share, 0.0, 1.0), left);
  if (line == shown_) return;
  fmt::print(stderr, "\r\033[K{}", line);
  std::fflush(stderr);
  shown_ = line;
}

}  // namespace trammel::cli
