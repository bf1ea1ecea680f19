// Answers of Weka's J48 as JSON lines. Run: java -cp weka.jar AskWeka.java REQUESTS
// REQUESTS: one request a line, tab separated: an ARFF file, then J48 options separated by spaces.
// Each answer: the tree (n, dist, class, att, thr, bags, children), and class and distribution for every row of the file.

import java.io.BufferedReader;
import java.io.FileReader;
import java.lang.reflect.Field;
import java.util.Locale;
import weka.classifiers.trees.J48;
import weka.classifiers.trees.j48.ClassifierSplitModel;
import weka.classifiers.trees.j48.ClassifierTree;
import weka.classifiers.trees.j48.Distribution;
import weka.core.Instances;
import weka.core.Utils;

public class AskWeka {
  static Object field(Class<?> owner, Object of, String name) throws Exception {
    Field field = owner.getDeclaredField(name);
    field.setAccessible(true);
    return field.get(of);
  }

  static String number(double value) {
    return Double.toString(value);
  }

  static void node(ClassifierTree tree, Instances data, StringBuilder out) throws Exception {
    ClassifierSplitModel model = tree.getLocalModel();
    Distribution distribution = model.distribution();
    out.append("{\"n\":").append(number(distribution.total())).append(",\"dist\":[");
    for (int k = 0; k < distribution.numClasses(); k++) {
      out.append(k > 0 ? "," : "").append(number(distribution.perClass(k)));
    }
    out.append("],\"class\":").append(distribution.maxClass());
    if (!tree.isLeaf()) {
      int attribute = (Integer) field(model.getClass(), model, "m_attIndex");
      boolean nominal = data.attribute(attribute).isNominal();
      boolean binary = model.getClass().getSimpleName().equals("BinC45Split");
      double split = (Double) field(model.getClass(), model, "m_splitPoint");
      String threshold = !nominal ? number(split) : binary ? String.valueOf((int) split) : "null";
      out.append(",\"att\":").append(attribute).append(",\"thr\":").append(threshold).append(",\"bags\":[");
      for (int i = 0; i < distribution.numBags(); i++) {
        out.append(i > 0 ? "," : "").append(number(distribution.perBag(i)));
      }
      out.append("],\"children\":[");
      for (int i = 0; i < tree.getSons().length; i++) {
        out.append(i > 0 ? "," : "");
        node(tree.getSons()[i], data, out);
      }
      out.append("]");
    }
    out.append("}");
  }

  public static void main(String[] arguments) throws Exception {
    Locale.setDefault(Locale.ROOT);
    try (BufferedReader requests = new BufferedReader(new FileReader(arguments[0]))) {
      for (String line = requests.readLine(); line != null; line = requests.readLine()) {
        String[] request = line.split("\t");
        Instances data = new Instances(new BufferedReader(new FileReader(request[0])));
        data.setClassIndex(data.numAttributes() - 1);
        J48 j48 = new J48();
        j48.setOptions(Utils.splitOptions(request.length > 1 ? request[1] : ""));
        j48.buildClassifier(data);
        ClassifierTree root = (ClassifierTree) field(J48.class, j48, "m_root");
        StringBuilder out = new StringBuilder("{\"tree\":");
        node(root, data, out);
        out.append(",\"pred\":[");
        StringBuilder rows = new StringBuilder();
        for (int i = 0; i < data.numInstances(); i++) {
          out.append(i > 0 ? "," : "").append((int) j48.classifyInstance(data.instance(i)));
          rows.append(i > 0 ? ",[" : "[");
          double[] shares = j48.distributionForInstance(data.instance(i));
          for (int k = 0; k < shares.length; k++) {
            rows.append(k > 0 ? "," : "").append(number(shares[k]));
          }
          rows.append("]");
        }
        out.append("],\"dist\":[").append(rows).append("],\"text\":\"");
        out.append(j48.toString().replace("\\", "\\\\").replace("\n", "\\n").replace("\t", "\\t").replace("\"", "\\\""));
        System.out.println(out.append("\"}"));
      }
    }
  }
}
