#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A diagnosis as a page that people look at: the verdict, every finding with its evidence, what
/// could not be told and where to measure next. HTML with everything inside; opens without a
/// network. `cell` is the one diagnosed: its name, its kinds of joints, and how far each joint's
/// axis is from the tool. `after_repair`: a section that stands before the budget.
[[nodiscard]] std::string diagnosis_page(const Diagnosis& diagnosis, const Cell& cell,
                                         const std::string& after_repair = "");

}  // namespace trammel
