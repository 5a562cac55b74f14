// Has what check_image.py must find: a virtual function that calls through a virtual table.
struct Node {
    virtual int sum(int depth) = 0;
};
Node* volatile next;
struct Link final : Node {
    int sum(int depth) override { return depth == 0 ? 0 : next->sum(depth - 1) + 1; }
};
Link link_of_chain;
int main() {
    next = &link_of_chain;
    return next->sum(3);
}
