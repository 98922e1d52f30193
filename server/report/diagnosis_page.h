#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A diagnosis as a page for people: the verdict, every finding with its evidence, the open
/// questions, and the next poses to measure. HTML with everything inside; opens without a network.
/// `cell` is the diagnosed one: its name, its kinds of joints, and the distance of each joint's
/// axis from the tool. `after_repair`: a section before the budget.
[[nodiscard]] std::string diagnosis_page(const Diagnosis& diagnosis, const Cell& cell,
                                         const std::string& after_repair = "");

}  // namespace trammel
