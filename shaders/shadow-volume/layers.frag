flat in float weight;
out float count;

void main() { count = weight; }
