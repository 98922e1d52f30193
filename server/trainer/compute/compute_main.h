#pragma once

#include <string>
#include <vector>

namespace trammel {

/// The word that makes a program of ours one that computes, as its first argument.
inline constexpr const char* kComputeWord = "--compute";

/// The main() of the process that computes one job: takes its task from the socket that
/// ChildProcess gave it, answers there, and ends when the other end does. It is nobody's
/// competitor: it runs when others leave the processor idle enough, within its limits, is the first
/// to go where memory runs out, and does not outlive the one that started it. `arguments`: what
/// ChildProcess::start() appended. Returns the exit code.
[[nodiscard]] int compute_main(const std::vector<std::string>& arguments);

}  // namespace trammel
