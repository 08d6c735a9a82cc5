// The headers that the tests share, precompiled: tests/CMakeLists.txt.
int main() { return 0; }
