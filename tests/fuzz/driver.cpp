// Replays a target's corpus and then runs changed inputs, without coverage: what CI does, and what
// runs longest on a plain build. An input whose outcome is new is kept as one to change further.
#include <fcntl.h>
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "server/base/check.h"
#include "server/base/plain_text.h"
#include "tests/fuzz/target.h"

namespace trammel::fuzz {

const Target* find_target(std::string_view name) {
  for (const Target& target : targets()) {
    if (name == target.name) return &target;
  }
  return nullptr;
}

std::string words_of(const Error& error) {
  const std::string said = sentence(error);
  TRAMMEL_CHECK(is_plain_lines(said));
  std::string words = std::string(to_text(error.code)) + " ";
  bool quoted = false;
  for (const char c : error.message.substr(0, 160)) {
    if (c == '\'' || c == '`') quoted = !quoted;
    if (!quoted && (std::isalpha(static_cast<unsigned char>(c)) != 0 || c == ' ')) words += c;
  }
  return words;
}

namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string target, corpus, keep;
  std::uint64_t runs = 0;
  std::uint64_t seed = 1;
  double seconds = 1e9;
  bool list = false;
};

/// The input under way, for whoever looks at a crash.
const std::string* under_way = nullptr;
const char* crash_file = "crash-input";

void keep_input(int number) {
  const int file = ::open(crash_file, O_CREAT | O_WRONLY | O_TRUNC, 0644);
  if (file >= 0 && under_way != nullptr) {
    for (std::size_t at = 0; at < under_way->size();) {
      const ssize_t written = ::write(file, under_way->data() + at, under_way->size() - at);
      if (written <= 0) break;
      at += static_cast<std::size_t>(written);
    }
  }
  static constexpr std::string_view kSaid = "the input of this crash is in crash-input\n";
  static_cast<void>(::write(STDERR_FILENO, kSaid.data(), kSaid.size()));
  ::signal(number, SIG_DFL);
  ::raise(number);
}

/// On a stack of its own: the crash may be that the stack is used up.
void keep_inputs_of_crashes() {
  static std::vector<char> stack(std::size_t{1} << 16);
  const stack_t its{.ss_sp = stack.data(), .ss_flags = 0, .ss_size = stack.size()};
  ::sigaltstack(&its, nullptr);
  struct sigaction action {};
  action.sa_handler = keep_input;
  action.sa_flags = SA_ONSTACK;
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGPROF})
    ::sigaction(number, &action, nullptr);
}

/// From now on the process may compute so long, s; 0: as long as it likes. Counts its own time: the
/// machine may be busy.
void compute_at_most(int seconds) {
  itimerval limit{};
  limit.it_value.tv_sec = seconds;
  ::setitimer(ITIMER_PROF, &limit, nullptr);
}

constexpr int kLongestRun = 20;  // s, of one input: a reader that takes longer hangs

std::string run_one(const Target& target, const std::string& input) {
  under_way = &input;
  compute_at_most(kLongestRun);
  std::string outcome = target.run(input);
  compute_at_most(0);
  under_way = nullptr;
  return outcome;
}

std::vector<std::string> inputs_of(const Target& target, const std::string& corpus) {
  std::vector<std::string> inputs =
      target.seeds == nullptr ? std::vector<std::string>{} : target.seeds();
  std::set<fs::path> files;
  const fs::path folder = fs::path(corpus) / target.name;
  if (fs::is_directory(folder)) files = {fs::directory_iterator(folder), fs::directory_iterator()};
  for (const fs::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    inputs.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return inputs;
}

int run(const Target& target, const Arguments& arguments) {
  static constexpr std::size_t kMostKept = 4000;
  const auto began = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  };
  std::vector<std::string> inputs = inputs_of(target, arguments.corpus);
  if (inputs.empty()) {
    fmt::print(stderr, "{}: no input to start from in {}\n", target.name, arguments.corpus);
    return 2;
  }
  std::set<std::string> outcomes;
  for (const std::string& input : inputs) outcomes.insert(run_one(target, input));
  const std::size_t replayed = inputs.size();
  Random random(arguments.seed);
  std::uint64_t runs = 0;
  for (; runs < arguments.runs && seconds() < arguments.seconds; ++runs) {
    std::string input =
        inputs[std::uniform_int_distribution<std::size_t>(0, inputs.size() - 1)(random)];
    for (auto changes = std::uniform_int_distribution<int>(1, 4)(random); changes > 0; --changes)
      input = target.mutate(input, random, target.longest);
    if (outcomes.insert(run_one(target, input)).second && inputs.size() < kMostKept)
      inputs.push_back(std::move(input));
  }
  fmt::print("{}: {} inputs replayed, {} changed ones run, {} outcomes, {:.0f} s\n", target.name,
             replayed, runs, outcomes.size(), seconds());
  return 0;
}

}  // namespace
}  // namespace trammel::fuzz

int main(int argc, char** argv) {
  CLI::App app(
      "Runs a reader on its corpus and on changed inputs; ends by a signal where one crashes it.");
  trammel::fuzz::Arguments arguments;
  app.add_option("target", arguments.target, "Its name; all where none is given");
  app.add_option("--corpus", arguments.corpus, "Folder with a folder for each target")->required();
  app.add_option("--runs", arguments.runs, "Changed inputs of each target");
  app.add_option("--seconds", arguments.seconds, "Longest time of each target");
  app.add_option("--seed", arguments.seed, "Of the changes");
  app.add_flag("--list", arguments.list, "Only print the names");
  CLI11_PARSE(app, argc, argv);
  trammel::fuzz::keep_inputs_of_crashes();
  if (!arguments.target.empty() && trammel::fuzz::find_target(arguments.target) == nullptr) {
    fmt::print(stderr, "there is no target {}\n", arguments.target);
    return 2;
  }
  for (const trammel::fuzz::Target& target : trammel::fuzz::targets()) {
    if (!arguments.target.empty() && arguments.target != target.name) continue;
    if (arguments.list) {
      fmt::print("{}\n", target.name);
    } else if (const int failed = run(target, arguments); failed != 0) {
      return failed;
    }
  }
  return 0;
}
