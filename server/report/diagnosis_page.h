#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A diagnosis as a page that people look at: the verdict, every finding with its evidence, what
/// could not be told and where to measure next. HTML with everything inside; opens without a
/// network. `cell` is the one diagnosed: its name, its kinds of joints, and how far each joint's
/// axis is from the tool.
[[nodiscard]] std::string diagnosis_page(const Diagnosis& diagnosis, const Cell& cell);

}  // namespace trammel
