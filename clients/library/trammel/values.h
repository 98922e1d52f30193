#pragma once

// What is installed as this header is the room's own.
#include "server/exchange/values.h"
