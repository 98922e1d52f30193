#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"

namespace trammel::cli {

/// The arguments of `trammel diagnose`.
struct DiagnoseArguments {
  std::string cell, report, next_poses, json, model, cell_out, since;
  std::vector<std::string> batches;  ///< at a service one at most
  std::uint64_t seed = 1;
  bool apply = false, strict = false, prove = false;
  double prove_minutes = 10;
  ServiceOptions service;
};

/// Text for people, left out where a result goes to standard output.
void say(const std::string& text, const DiagnoseArguments& arguments);

/// Page, next poses and JSON, where they are asked for.
[[nodiscard]] Outputs outputs_of(const DiagnoseArguments& arguments);
/// Writes the findings, with everything else that was put into `outputs`; says why there are no
/// next poses where there are none.
[[nodiscard]] Status write_diagnosis(const nlohmann::ordered_json& json, std::string page,
                                     Outputs& outputs, const DiagnoseArguments& arguments);

/// True if --strict asks for a model that lacks nothing and this one lacks something, which it says
/// on standard error.
[[nodiscard]] bool leaves_open(const nlohmann::ordered_json& json,
                               const DiagnoseArguments& arguments);

/// Has a service diagnose one of its batches (`batches` names it; none: the newest) or a file,
/// waits, and writes what it found. False where the result was to be put in force and was not, or
/// leaves_open().
[[nodiscard]] Result<bool> diagnose_at_service(const DiagnoseArguments& arguments);

}  // namespace trammel::cli
