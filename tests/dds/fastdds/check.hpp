// What both programs tell: a line for each check, and how many failed.
#pragma once

#include <cstdio>
#include <string>

inline int failed = 0;

inline void check(const char* what, bool right, const std::string& detail = "") {
    std::printf("%s %s %s\n", right ? "ok  " : "FAIL", what, detail.c_str());
    failed += right ? 0 : 1;
}
