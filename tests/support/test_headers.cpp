// The program whose precompiled headers all tests share (CMakeLists.txt); it does nothing.
int main() {}
