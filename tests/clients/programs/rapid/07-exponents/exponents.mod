MODULE Exponents
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST robtarget p1:=[[-1.25E+01,1.500E+02,4.0E2],[7.07107E-01,0,7.07107E-01,0],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[+0.5,+151.,.4E+03],[.707107,0,.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL p1,v100,fine,tSpindle\WObj:=wPanel;
    MoveL p2,v100,fine,tSpindle,\WObj:=wPanel;
  ENDPROC
ENDMODULE
