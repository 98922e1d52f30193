#pragma once

namespace trammel {

/// What the first page of a store's file says of it.
inline constexpr int kApplicationId = 0x54524D4C;  // "TRML"
inline constexpr int kSchemaVersion = 2;

}  // namespace trammel
